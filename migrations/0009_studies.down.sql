DROP TABLE study_sessions;
DROP TABLE study_events;
DROP TABLE study_seeds;
DROP TABLE study_protocols;
DROP TABLE studies;
