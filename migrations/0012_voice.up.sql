-- Voice: what a surgeon said aloud, in the pieces in which the page sent it while it was spoken. comment is the key of
-- the comment that it belongs to, whose kind is 'voice'; piece counts from 1. through_ms is how far the recording had
-- come at the piece's end, by the page. ended says on the last piece why the recording ended; without one it was cut
-- off. audio is empty where it was erased: bytes and sha256 stay.
CREATE TABLE voice_pieces (
    number INTEGER PRIMARY KEY,
    comment TEXT NOT NULL REFERENCES comments (key),
    session TEXT NOT NULL REFERENCES sessions,
    piece INTEGER NOT NULL CHECK (piece > 0),
    media_type TEXT NOT NULL,
    through_ms INTEGER NOT NULL CHECK (through_ms >= 0),
    ended TEXT CHECK (ended IN ('released', 'limit', 'microphone-lost', 'left')),
    bytes INTEGER NOT NULL,
    sha256 TEXT NOT NULL,
    audio BLOB,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    UNIQUE (comment, piece)
) STRICT;
CREATE INDEX voice_pieces_by_session ON voice_pieces (session, number);

-- Only the erasure of its comment takes the sound away, and nothing else with it.
CREATE TRIGGER voice_pieces_no_update BEFORE UPDATE ON voice_pieces
WHEN NEW.audio IS NOT NULL
    OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'comment' AND record = OLD.comment)
    OR (NEW.number, NEW.comment, NEW.session, NEW.piece, NEW.media_type, NEW.through_ms, NEW.ended, NEW.bytes,
        NEW.sha256, NEW.run, NEW.wall, NEW.monotonic_ns)
    IS NOT (OLD.number, OLD.comment, OLD.session, OLD.piece, OLD.media_type, OLD.through_ms, OLD.ended, OLD.bytes,
        OLD.sha256, OLD.run, OLD.wall, OLD.monotonic_ns)
BEGIN SELECT RAISE(ABORT, 'voice_pieces are append-only'); END;
CREATE TRIGGER voice_pieces_no_delete BEFORE DELETE ON voice_pieces
BEGIN SELECT RAISE(ABORT, 'voice_pieces are append-only'); END;
CREATE TRIGGER voice_pieces_no_replace BEFORE INSERT ON voice_pieces
WHEN EXISTS (
    SELECT 1 FROM voice_pieces
    WHERE number = NEW.number OR (comment = NEW.comment AND piece = NEW.piece))
BEGIN SELECT RAISE(ABORT, 'voice_pieces are append-only'); END;
