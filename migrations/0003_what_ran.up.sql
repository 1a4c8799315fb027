-- Frames are counted anew in each run, and a comment may be kept in a later one than it was made in; waited_ms is how long
-- it waited on the surgeon's device before it was sent.
ALTER TABLE comments ADD COLUMN frame_run INTEGER;
ALTER TABLE comments ADD COLUMN waited_ms INTEGER;
-- SHA-256 of each learned policy's weights, by its name: what `cnn-learned` was in this run.
ALTER TABLE runs ADD COLUMN weights TEXT NOT NULL DEFAULT '{}' CHECK (json_valid(weights));
