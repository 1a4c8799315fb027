ALTER TABLE runs DROP COLUMN weights;
ALTER TABLE comments DROP COLUMN waited_ms;
ALTER TABLE comments DROP COLUMN frame_run;
