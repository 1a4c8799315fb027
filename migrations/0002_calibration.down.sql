ALTER TABLE runs DROP COLUMN calibration;
