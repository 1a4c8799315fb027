DROP TRIGGER answers_no_replace;
DROP TRIGGER comments_no_replace;
DROP TRIGGER events_no_replace;
DROP TRIGGER segments_no_replace;
DROP TRIGGER sessions_no_replace;
