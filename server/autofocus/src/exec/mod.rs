//! Policies in another process: `exec:COMMAND` instead of a policy's name. The process looks at each frame in shared
//! memory and answers over a socket; `docs/policies.md` describes what travels.

mod command;
mod framing;
mod pool;
mod process;
mod settings;

pub use process::LAUNCH;
pub use settings::{ProcessSettings, Times};

use std::sync::Arc;

use self::command::Command;
use self::pool::{Missing, Pool, Shared};
use self::process::Process;
use super::{Decision, Fault, FieldOfView, Observation, Policy, PolicyError, Registry};
use parfocal_base::{BlurRate, PolicyName};

/// Prefix of the name of a policy that is a command.
pub const PREFIX: &str = "exec:";
const SUMMARY: &str = "a policy in another process";

/// Adds the policy of a command to `registry`, if `name` begins with [`PREFIX`]. Starts the process. If it cannot be
/// used, it is listed as unavailable, with the reason.
pub fn with_command(registry: Registry, name: &PolicyName, settings: &ProcessSettings) -> Registry {
    let Some(text) = name.as_str().strip_prefix(PREFIX) else { return registry };
    if registry.has(name) {
        return registry;
    }

    match prepare(text, settings) {
        Ok((pool, hash)) => {
            let pool = Arc::new(pool);
            let (own, checked, checked_pool) = (name.clone(), name.clone(), Arc::clone(&pool));
            let build = move || instance(&pool, &own).map(|policy| Box::new(policy) as Box<dyn Policy>);
            let check = move || checked_pool.check().map_err(|failed| starting(&checked, failed));
            let registry = registry.trying(name.as_str(), SUMMARY, build);
            registry.checked_by(name.as_str(), check).identified(name.as_str(), hash)
        }
        Err(reason) => registry.without(name.as_str(), SUMMARY, &reason),
    }
}

/// The pool of a command that answers, and what identifies the command.
fn prepare(text: &str, settings: &ProcessSettings) -> Result<(Pool, Option<String>), String> {
    let command = Command::parse(text)?;
    let hash = command.hash();
    let pool = Pool::new(command, settings.clone()).map_err(|error| format!("no thread is left for it: {error}"))?;

    // It comes back at once: what counts is that there is one.
    let late = || format!("it was not ready within {} s", settings.start.as_secs());
    let (process, shared) = pool.take(settings.start, true).map_err(|failed| failed.unwrap_or_else(late))?;
    shared.give_back(process, None);
    Ok((pool, hash))
}

fn starting(name: &PolicyName, failed: Missing) -> PolicyError {
    PolicyError::Starting { name: name.clone(), failed }
}

fn instance(pool: &Pool, name: &PolicyName) -> Result<External, PolicyError> {
    let (process, shared) = pool.take_for_instance().map_err(|failed| starting(name, failed))?;
    let wide = process.is_wide();
    Ok(External { process: Some(process), shared, wide, blur: None, frames: 0, anew: true, fault: None })
}

/// An instance: it borrows a process.
struct External {
    process: Option<Process>,
    shared: Arc<Shared>,
    wide: bool,
    blur: Option<BlurRate>,
    frames: u32,
    /// Whether the process must forget what it saw before it gets the next frame.
    anew: bool,
    fault: Option<Fault>,
}

impl External {
    fn time(&self) -> u64 {
        match self.shared.settings.times {
            Times::Clock => self.shared.settings.clock.now().as_nanos(),
            Times::Every(period) => (period * self.frames).as_nanos() as u64,
        }
    }

    fn ask(&mut self, seen: &Observation<'_>) -> Result<Decision, Fault> {
        let (time, blur, patience) = (self.time(), self.blur, self.shared.settings.answer);
        let Some(process) = &mut self.process else {
            return Err(self.fault.clone().unwrap_or(Fault::Late));
        };

        if self.anew {
            process.reset(time, blur)?;
            self.anew = false;
        }
        self.frames += 1;
        process.ask(seen, time, blur, patience)
    }
}

impl Policy for External {
    fn field_of_view(&self) -> FieldOfView {
        if self.wide { FieldOfView::Wide } else { FieldOfView::Patch }
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        match self.ask(seen) {
            Ok(decision) => decision,
            Err(fault) => {
                if let Some(process) = self.process.take() {
                    self.shared.give_back(process, Some(&fault));
                }
                self.fault = Some(fault);
                Decision { target: f64::NAN, ..Decision::default() }
            }
        }
    }

    fn learn_of(&mut self, blur: BlurRate) {
        self.blur = Some(blur);
    }

    fn forget(&mut self) {
        self.anew = true;
    }

    fn fault(&self) -> Option<Fault> {
        self.fault.clone()
    }
}

impl Drop for External {
    fn drop(&mut self) {
        if let Some(process) = self.process.take() {
            self.shared.give_back(process, None);
        }
    }
}
