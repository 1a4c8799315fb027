-- The chain: a row for each record that counts as evidence, written in the same transaction as the record.
-- docs/evidence.md
-- tells, byte for byte, what is hashed. place counts the rows of a session from 1. adopted marks what was recorded
-- before
-- this migration. sealed is the hash of what of the record can be withheld or erased; its salt is in chain_salts.
CREATE TABLE chain (
    number INTEGER PRIMARY KEY,
    wall TEXT NOT NULL,
    kind TEXT NOT NULL,
    key TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    place INTEGER,
    adopted INTEGER NOT NULL CHECK (adopted IN (0, 1)),
    salt TEXT NOT NULL,
    sealed TEXT NOT NULL,
    content TEXT NOT NULL,
    previous TEXT NOT NULL,
    hash TEXT NOT NULL,
    UNIQUE (kind, key)
) STRICT;
CREATE UNIQUE INDEX chain_by_session ON chain (session, place) WHERE session IS NOT NULL;

CREATE TABLE chain_salts (
    number INTEGER PRIMARY KEY REFERENCES chain,
    salt TEXT NOT NULL
) STRICT;

-- Who looked at what of the evidence: let in by a role's link, a focal path seen, an export, a backup, a restore.
CREATE TABLE accesses (
    number INTEGER PRIMARY KEY,
    run INTEGER REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER,
    role TEXT NOT NULL,
    kind TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    detail TEXT
) STRICT;

CREATE TRIGGER chain_no_update BEFORE UPDATE ON chain BEGIN SELECT RAISE(ABORT, 'chain is append-only'); END;
CREATE TRIGGER chain_no_delete BEFORE DELETE ON chain BEGIN SELECT RAISE(ABORT, 'chain is append-only'); END;
CREATE TRIGGER chain_no_replace BEFORE INSERT ON chain
WHEN EXISTS (SELECT 1 FROM chain WHERE number = NEW.number OR (kind = NEW.kind AND key = NEW.key)
    OR (session = NEW.session AND place = NEW.place))
BEGIN SELECT RAISE(ABORT, 'chain is append-only'); END;
CREATE TRIGGER chain_salts_no_update BEFORE UPDATE ON chain_salts
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;
CREATE TRIGGER chain_salts_no_delete BEFORE DELETE ON chain_salts
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;
CREATE TRIGGER chain_salts_no_replace BEFORE INSERT ON chain_salts
WHEN EXISTS (SELECT 1 FROM chain_salts WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;
CREATE TRIGGER accesses_no_update BEFORE UPDATE ON accesses BEGIN SELECT RAISE(ABORT, 'accesses are append-only'); END;
CREATE TRIGGER accesses_no_delete BEFORE DELETE ON accesses BEGIN SELECT RAISE(ABORT, 'accesses are append-only'); END;
CREATE TRIGGER accesses_no_replace BEFORE INSERT ON accesses
WHEN EXISTS (SELECT 1 FROM accesses WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'accesses are append-only'); END;
