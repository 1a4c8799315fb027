-- Where and when something was said. sequence counts up with everything that is said on a device; waited_by is the clock
-- that measured waited_ms; late is whether it arrived when nothing counted any more. Of several answers to a question the
-- one given last counts, late ones left aside. What was kept before this migration is ordered by its arrival, and not late.
ALTER TABLE comments ADD COLUMN device TEXT;
ALTER TABLE comments ADD COLUMN sequence INTEGER;
ALTER TABLE comments ADD COLUMN waited_by TEXT;
ALTER TABLE comments ADD COLUMN late INTEGER NOT NULL DEFAULT 0 CHECK (late IN (0, 1));
ALTER TABLE answers ADD COLUMN device TEXT;
ALTER TABLE answers ADD COLUMN sequence INTEGER;
ALTER TABLE answers ADD COLUMN client_millis INTEGER;
ALTER TABLE answers ADD COLUMN waited_ms INTEGER;
ALTER TABLE answers ADD COLUMN waited_by TEXT;
ALTER TABLE answers ADD COLUMN late INTEGER NOT NULL DEFAULT 0 CHECK (late IN (0, 1));

-- How much of what was said in a session each surgeon's device held when it last told.
CREATE TABLE surgeon_devices (
    session TEXT NOT NULL REFERENCES sessions,
    device TEXT NOT NULL,
    holding INTEGER NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    monotonic_ns INTEGER NOT NULL,
    PRIMARY KEY (session, device)
) STRICT, WITHOUT ROWID;
