-- How fast the optic blurs, as the policies were told at the start of the server: pixels a unit of focal power; NULL where
-- they were told nothing.
ALTER TABLE runs ADD COLUMN blur REAL;
