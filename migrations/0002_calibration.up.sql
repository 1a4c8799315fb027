-- Which calibration of the sensor a start of the server worked with.
ALTER TABLE runs ADD COLUMN calibration TEXT NOT NULL DEFAULT 'not recorded';
