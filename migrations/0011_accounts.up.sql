-- Personal accounts. Of a passphrase only its argon2id hash is kept, with what it was made with (hexadecimal). Accounts
-- are never removed: records name them.
CREATE TABLE accounts (
    account TEXT PRIMARY KEY,
    display TEXT NOT NULL UNIQUE,
    role TEXT NOT NULL CHECK (role IN ('lead', 'operator', 'researcher', 'monitor')),
    disabled INTEGER NOT NULL CHECK (disabled IN (0, 1)),
    memory_kib INTEGER NOT NULL,
    passes INTEGER NOT NULL,
    salt TEXT NOT NULL,
    hash TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TRIGGER accounts_no_delete BEFORE DELETE ON accounts
BEGIN SELECT RAISE(ABORT, 'accounts are never removed'); END;

-- Working notes: the browsers that are signed in, by the SHA-256 of their token. Times are of the wall clock.
CREATE TABLE sign_ins (
    token_sha256 TEXT PRIMARY KEY,
    account TEXT NOT NULL REFERENCES accounts,
    began TEXT NOT NULL,
    used TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX sign_ins_by_account ON sign_ins (account);

-- What happened to accounts, sign-ins included. account is empty where somebody gave a name that no account has: it may
-- be a passphrase in the wrong field. done_by is the account of whoever did it; empty for the command line, and for a
-- failed attempt. run and monotonic_ns are empty for the command line.
CREATE TABLE account_events (
    number INTEGER PRIMARY KEY,
    run INTEGER REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER,
    account TEXT REFERENCES accounts,
    kind TEXT NOT NULL,
    done_by TEXT REFERENCES accounts,
    detail TEXT
) STRICT;

-- Under which account a record was made: a row beside the record, which is named by its kind and its key in the chain.
CREATE TABLE actors (
    number INTEGER PRIMARY KEY,
    kind TEXT NOT NULL,
    record TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    account TEXT NOT NULL REFERENCES accounts,
    display TEXT NOT NULL,
    UNIQUE (kind, record)
) STRICT;
CREATE INDEX actors_by_session ON actors (session, number);

CREATE TRIGGER account_events_no_update BEFORE UPDATE ON account_events
BEGIN SELECT RAISE(ABORT, 'account_events are append-only'); END;
CREATE TRIGGER account_events_no_delete BEFORE DELETE ON account_events
BEGIN SELECT RAISE(ABORT, 'account_events are append-only'); END;
CREATE TRIGGER account_events_no_replace BEFORE INSERT ON account_events
WHEN EXISTS (SELECT 1 FROM account_events WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'account_events are append-only'); END;
CREATE TRIGGER actors_no_update BEFORE UPDATE ON actors BEGIN SELECT RAISE(ABORT, 'actors are append-only'); END;
CREATE TRIGGER actors_no_delete BEFORE DELETE ON actors BEGIN SELECT RAISE(ABORT, 'actors are append-only'); END;
CREATE TRIGGER actors_no_replace BEFORE INSERT ON actors
WHEN EXISTS (SELECT 1 FROM actors WHERE number = NEW.number OR (kind = NEW.kind AND record = NEW.record))
BEGIN SELECT RAISE(ABORT, 'actors are append-only'); END;
