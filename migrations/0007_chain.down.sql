DROP TABLE accesses;
DROP TABLE chain_salts;
DROP TABLE chain;
