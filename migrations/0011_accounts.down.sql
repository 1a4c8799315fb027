DROP TABLE actors;
DROP TABLE account_events;
DROP TABLE sign_ins;
DROP TABLE accounts;
