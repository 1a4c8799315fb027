//! How the lens was driven in each setting, computed from the telemetry of an export.

use super::files::ExportFiles;
use crate::store::LensMotion;
use crate::store::motion::RunningFigures;

/// The file with a row for each step of the control loop.
const FILE: &str = "telemetry.csv";

impl ExportFiles {
    /// How the lens was driven in each setting that has telemetry: the figures that the session's database has.
    ///
    /// # Errors
    /// If the telemetry cannot be read. The text names the file.
    pub fn motions(&self) -> Result<Vec<LensMotion>, String> {
        let column = |name| self.place(FILE, name);
        let places = ["setting", "run", "exposed_ns", "asked", "measured", "optimal", "held"];
        let places = places.map(column).into_iter().collect::<Result<Vec<_>, _>>()?;

        let mut settings: Vec<(usize, RunningFigures)> = Vec::new();
        self.each_row(FILE, |row| {
            let cell = |place: usize| row.get(places[place]).unwrap_or_default();
            let wrong = |place: usize| format!("{FILE}: '{}' is not a number", cell(place));
            let whole = |place: usize| cell(place).parse::<i64>().map_err(|_| wrong(place));
            let number = |place: usize| match cell(place) {
                "" => Ok(None),
                text => text.parse::<f64>().map(Some).map_err(|_| wrong(place)),
            };

            let setting = cell(0).parse().map_err(|_| wrong(0))?;
            if settings.last().is_none_or(|(last, _)| *last != setting) {
                settings.push((setting, RunningFigures::default()));
            }
            let asked = number(3)?.ok_or_else(|| wrong(3))?;
            let step = (whole(1)?, whole(2)?, asked, number(4)?, number(5)?, cell(6) == "true");
            if let Some((_, figures)) = settings.last_mut() {
                figures.take(&step);
            }
            Ok(())
        })?;

        let driven = settings.into_iter().filter(|(_, figures)| figures.motion.frames > 0);
        Ok(driven.map(|(setting, figures)| LensMotion { setting, ..figures.motion }).collect())
    }
}
