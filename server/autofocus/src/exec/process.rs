//! A process that is a policy: its socket, its shared memory, and its output.
//!
//! It is started by the program itself (`Settings::launcher`), which arranges its file descriptors and has the kernel end
//! it with the program. So no code runs between fork and exec.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Write};
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::fs::FileExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStdout, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};
use socket2::{Domain, Socket, Type};

use super::command::Command;
use super::framing::{ANSWER_BYTES, Answer, BELIEF_AT, Kind, MEMORY_BYTES, Question, Saying};
use super::settings::ProcessSettings;
use crate::{Decision, Fault, Observation};
use parfocal_base::clock::Moment;
use parfocal_base::{BlurRate, FocalPower, priority};
use parfocal_imaging::{PATCH_SIDE, Patch, View, WIDER};

/// Hidden command of the program that turns into a policy's process.
pub const LAUNCH: &str = "policy-process";

/// Longest line of its output that is shown; the rest is another line.
const LONGEST_LINE: u64 = 2048;
/// Time for a process to end by itself after its socket was closed.
const FAREWELL: Duration = Duration::from_millis(200);

/// A process that is ready.
pub struct Process {
    child: Child,
    socket: Socket,
    memory: File,
    output: Output,
    /// Pictures of a frame that it looks at.
    pictures: usize,
    sequence: u64,
    /// When it became ready.
    pub ready_since: Moment,
}

impl Process {
    /// Starts `command`, waits until it is ready, and asks it about two test pictures.
    ///
    /// # Errors
    /// If it cannot be started, ends, sends something else, is not ready in time, or does not answer with focal powers.
    pub fn start(command: &Command, settings: &ProcessSettings) -> Result<Self, String> {
        let (socket, theirs) = Socket::pair(Domain::UNIX, Type::SEQPACKET, None).map_err(no_means)?;
        let memory = memory().map_err(no_means)?;
        let their_memory = memory.try_clone().map_err(no_means)?;

        let mut launch = std::process::Command::new(&settings.launcher);
        launch.arg(LAUNCH).arg(std::process::id().to_string()).arg("--").args(&command.words);
        // A group of its own: Ctrl-C at the terminal ends the program, which then ends the process.
        launch.process_group(0);
        launch.stdin(OwnedFd::from(theirs)).stdout(Stdio::piped()).stderr(their_memory);
        let mut child = launch.spawn().map_err(no_means)?;
        // It holds the other end of the socket. Only the process may, so that its end is noticed.
        drop(launch);

        let output = Output::listen(child.stdout.take(), settings.say).map_err(no_means)?;
        let ready_since = settings.clock.now();
        let mut process = Self { child, socket, memory, output, pictures: 1, sequence: 0, ready_since };

        match process.receive(settings.start) {
            Ok(Answer { saying: Saying::Ready(pictures), .. }) => process.pictures = pictures as usize,
            Ok(_) => return Err("it answered before it said that it is ready".to_owned()),
            Err(Fault::Late) => {
                let seconds = settings.start.as_secs();
                return Err(process.with_last_line(format!("it was not ready within {seconds} s")));
            }
            Err(fault) => return Err(process.with_last_line(fault.to_string())),
        }
        if let Err(fault) = process.answer_tests(settings) {
            return Err(process.with_last_line(format!("it failed at a test picture: {fault}")));
        }

        process.ready_since = settings.clock.now();
        Ok(process)
    }

    /// Asks it about two test pictures. The first may take as long as its start, because some models load at their
    /// first use.
    fn answer_tests(&mut self, settings: &ProcessSettings) -> Result<(), Fault> {
        let textured = |index: usize| f32::from((index * 7919 + index * index * 31) as u8);
        let tests: [(&dyn Fn(usize) -> f32, Duration); 2] =
            [(&|_| 128.0, settings.start), (&textured, settings.answer)];

        self.reset(0, None)?;
        for (levels, patience) in tests {
            let patch = Patch(std::array::from_fn(levels));
            let view = View { wider: [Some(patch); WIDER.len()], ..View::from(patch) };
            let seen = Observation { view: &view, focal_power: FocalPower::MIDDLE };

            let target = self.ask(&seen, 0, None, patience)?.target;
            FocalPower::new(target).map_err(|_| Fault::Nonsense(format!("{target} as a focal power")))?;
        }
        Ok(())
    }

    /// Whether it looks at the wider patches, too.
    pub const fn is_wide(&self) -> bool {
        self.pictures > 1
    }

    /// Whether it still runs.
    pub fn is_alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Tells it that another setting or scan begins.
    ///
    /// # Errors
    /// If it has ended.
    pub fn reset(&mut self, time: u64, blur: Option<BlurRate>) -> Result<(), Fault> {
        self.send(Kind::Reset, f64::NAN, time, blur)
    }

    /// Asks it about a frame, and waits for the answer for at most `patience`.
    ///
    /// # Errors
    /// If there is no answer that can be used. The process should not be asked again.
    pub fn ask(
        &mut self,
        seen: &Observation<'_>,
        time: u64,
        blur: Option<BlurRate>,
        patience: Duration,
    ) -> Result<Decision, Fault> {
        self.show(seen).map_err(|error| Fault::Ended(format!("its shared memory failed: {error}")))?;
        self.send(Kind::Frame, seen.focal_power.get(), time, blur)?;

        let answer = self.receive(patience)?;
        if answer.sequence != self.sequence {
            let sequence = answer.sequence;
            return Err(Fault::Nonsense(format!("an answer to question {sequence}, not {}", self.sequence)));
        }
        let Some(target) = answer.saying.target(seen.focal_power) else {
            return Err(Fault::Nonsense("that it is ready, where a focal power was asked for".to_owned()));
        };

        let belief = (answer.belief > 0).then(|| self.belief(answer.belief as usize)).transpose();
        let belief = belief.map_err(|error| Fault::Ended(format!("its shared memory failed: {error}")))?;
        Ok(Decision { target, metric: answer.metric.is_finite().then_some(answer.metric), belief })
    }

    /// Writes the pictures into the shared memory.
    fn show(&self, seen: &Observation<'_>) -> io::Result<()> {
        // A picture that is too small for a coarser scale shows the patch there.
        let wider = seen.view.wider.iter().map(|wider| wider.as_ref().unwrap_or(&seen.view.patch));
        let pictures = std::iter::once(&seen.view.patch).chain(wider).take(self.pictures);
        let bytes: Vec<u8> =
            pictures.flat_map(|Patch(levels)| levels.iter().flat_map(|level| level.to_le_bytes())).collect();
        self.memory.write_all_at(&bytes, 0)
    }

    fn belief(&self, values: usize) -> io::Result<Arc<[f32]>> {
        let mut bytes = vec![0; 4 * values];
        self.memory.read_exact_at(&mut bytes, BELIEF_AT)?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|&value| f32::from_le_bytes(value)).collect())
    }

    fn send(&mut self, kind: Kind, focal_power: f64, time: u64, blur: Option<BlurRate>) -> Result<(), Fault> {
        self.sequence += 1;
        let question = Question {
            kind,
            sequence: self.sequence,
            focal_power,
            time,
            pictures: if kind == Kind::Frame { self.pictures as u32 } else { 0 },
            side: PATCH_SIDE as u32,
            blur: blur.map_or(f64::NAN, BlurRate::get),
        };

        match (&self.socket).write(&question.bytes()) {
            Ok(_) => Ok(()),
            // Its queue is full: it has not read for hundreds of questions.
            Err(error) if error.kind() == ErrorKind::WouldBlock => Err(Fault::Late),
            Err(_) => Err(self.ended()),
        }
    }

    fn receive(&mut self, patience: Duration) -> Result<Answer, Fault> {
        // One byte more, so that a longer message is noticed.
        let mut bytes = [0; ANSWER_BYTES + 1];
        let timeout = Some(patience.max(Duration::from_millis(1)));
        self.socket.set_read_timeout(timeout).map_err(|error| Fault::Ended(error.to_string()))?;

        loop {
            match (&self.socket).read(&mut bytes) {
                Ok(0) => return Err(self.ended()),
                Ok(count) => return Answer::parse(&bytes[..count]).map_err(Fault::Nonsense),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    return Err(Fault::Late);
                }
                Err(_) => return Err(self.ended()),
            }
        }
    }

    /// Why its socket is closed.
    fn ended(&mut self) -> Fault {
        // It closes its files a moment before it can be waited for.
        await_end(&self.child, FAREWELL);
        Fault::Ended(match self.child.try_wait() {
            Ok(Some(status)) => format!("its process ended ({})", described(status)),
            _ => "it closed its socket".to_owned(),
        })
    }

    /// `what`, with the last line that the process printed.
    fn with_last_line(mut self, what: String) -> String {
        self.end(Duration::ZERO);
        match self.output.last_line() {
            Some(line) => format!("{what}; its last line: {line}"),
            None => what,
        }
    }

    /// Ends it and all that it started, after it had `farewell` to end by itself.
    fn end(&mut self, farewell: Duration) {
        let _ = self.socket.shutdown(Shutdown::Both);
        if !farewell.is_zero() {
            await_end(&self.child, farewell);
        }
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
        let _ = self.child.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end(FAREWELL);
    }
}

/// Waits until `child` ends, for at most `longest`. Leaves it to be waited for.
fn await_end(child: &Child, longest: Duration) {
    if let Ok(descriptor) = pidfd_open(Pid::from_child(child), PidfdFlags::empty()) {
        let timeout = Timespec::try_from(longest).ok();
        let _ = poll(&mut [PollFd::new(&descriptor, PollFlags::IN)], timeout.as_ref());
    }
}

fn described(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => format!("signal {signal}"),
        (None, None) => "no exit code".to_owned(),
    }
}

/// The shared memory. Its size stays, whatever the process does.
fn memory() -> io::Result<File> {
    let memory = memfd_create("parfocal-policy", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
    let memory = File::from(memory);
    memory.set_len(MEMORY_BYTES)?;
    fcntl_add_seals(&memory, SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL)?;
    Ok(memory)
}

fn no_means(error: impl Into<io::Error>) -> String {
    format!("the system did not let it start: {}", error.into())
}

/// What a process prints.
struct Output {
    last: Arc<Mutex<String>>,
    /// Ends when nobody can print any more.
    open: Receiver<()>,
}

impl Output {
    /// Gives every line that comes from `stdout` to `say`, on a thread of its own.
    fn listen(stdout: Option<ChildStdout>, say: fn(&str)) -> io::Result<Self> {
        let last = Arc::new(Mutex::new(String::new()));
        let kept = Arc::clone(&last);
        let (printing, open) = channel();

        std::thread::Builder::new().name("policy-output".into()).spawn(move || {
            let _printing: std::sync::mpsc::Sender<()> = printing;
            priority::lower();
            let Some(stdout) = stdout else { return };
            let mut stdout = BufReader::new(stdout);
            while let Some(line) = next_line(&mut stdout) {
                say(&line);
                if !line.trim().is_empty() {
                    line.trim().clone_into(&mut kept.lock().unwrap_or_else(PoisonError::into_inner));
                }
            }
        })?;
        Ok(Self { last, open })
    }

    /// The last line that is not empty, of a process that has ended.
    fn last_line(&self) -> Option<String> {
        let _ = self.open.recv_timeout(FAREWELL);
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        (!last.is_empty()).then_some(last)
    }
}

/// The next line of what need not be text, and need not end; `None` at the end.
fn next_line(stdout: &mut BufReader<ChildStdout>) -> Option<String> {
    let mut line = Vec::new();
    match stdout.take(LONGEST_LINE).read_until(b'\n', &mut line) {
        Ok(0) | Err(_) => None,
        Ok(_) => Some(String::from_utf8_lossy(&line).trim_end_matches(['\n', '\r']).to_owned()),
    }
}
