-- Children before parents, so that foreign keys hold throughout. Dropping a table drops its triggers and indices.
DROP TABLE device_events;
DROP TABLE telemetry;
DROP TABLE policies;
DROP TABLE session_clocks;
DROP TABLE answers;
DROP TABLE comments;
DROP TABLE events;
DROP TABLE segments;
DROP TABLE sessions;
DROP TABLE participants;
DROP TABLE runs;
