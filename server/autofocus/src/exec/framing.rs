//! What the program and a policy's process say to each other, as bytes. `docs/policies.md` describes it for those who
//! write such a process.

use parfocal_base::FocalPower;

/// First bytes of every message.
const MAGIC: [u8; 4] = *b"PFPO";
/// Version of the framing.
const VERSION: u16 = 1;
/// Bytes of a question.
const QUESTION_BYTES: usize = 64;
/// Bytes of an answer.
pub const ANSWER_BYTES: usize = 40;

/// Bytes of the shared memory.
pub const MEMORY_BYTES: u64 = 32_768;
/// Where a belief begins in the shared memory. Pictures begin at 0.
pub const BELIEF_AT: u64 = 16_384;
/// Most values of a belief.
const MOST_BELIEF: u32 = 4096;

const PATCHES: u32 = 1;
/// Pictures of a process that also wants the two wider patches.
const VIEW: u32 = 3;

/// What a question is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Forget everything: another setting or scan begins. Has no answer.
    Reset = 2,
    /// A frame, whose answer is a focal power or a step.
    Frame = 3,
}

/// A message to the process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question {
    /// What it is about.
    pub kind: Kind,
    /// Number of the question; the answer repeats it.
    pub sequence: u64,
    /// Focal power at which the frame was exposed.
    pub focal_power: f64,
    /// Time in nanoseconds.
    pub time: u64,
    /// Pictures in the shared memory.
    pub pictures: u32,
    /// Values along each side of a picture.
    pub side: u32,
    /// Blur rate of the optics; NaN if it is unknown.
    pub blur: f64,
}

impl Question {
    /// The message.
    pub fn bytes(&self) -> [u8; QUESTION_BYTES] {
        let mut bytes = [0; QUESTION_BYTES];
        let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);

        put(0, &MAGIC);
        put(4, &VERSION.to_le_bytes());
        put(6, &(self.kind as u16).to_le_bytes());
        put(8, &self.sequence.to_le_bytes());
        put(16, &self.focal_power.to_le_bytes());
        put(24, &self.time.to_le_bytes());
        put(32, &self.pictures.to_le_bytes());
        put(36, &self.side.to_le_bytes());
        put(40, &self.side.to_le_bytes());
        // The pictures' place in the shared memory is 0.
        put(48, &(self.pictures * self.side * self.side * 4).to_le_bytes());
        put(56, &self.blur.to_le_bytes());
        bytes
    }
}

/// What an answer says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Saying {
    /// The process is ready, and looks at so many pictures of a frame.
    Ready(u32),
    /// The lens should go to this focal power.
    Target(f64),
    /// The focal power should change by this much.
    Step(f64),
}

/// A message from the process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Number of the question.
    pub sequence: u64,
    /// What it says.
    pub saying: Saying,
    /// The focus metric that the policy computed; NaN if it has none.
    pub metric: f64,
    /// Values of its belief in the shared memory; 0 if it has none.
    pub belief: u32,
}

impl Answer {
    /// Reads a message.
    ///
    /// # Errors
    /// If it is not one. The error continues the words "it sent".
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        if bytes.len() != ANSWER_BYTES {
            return Err(format!("{} bytes where an answer has {ANSWER_BYTES}", bytes.len()));
        }
        if field(bytes, 0) != MAGIC {
            return Err("bytes that do not begin with PFPO".to_owned());
        }
        let version = u16::from_le_bytes(field(bytes, 4));
        if version != VERSION {
            return Err(format!("an answer of version {version}, not {VERSION}"));
        }

        let value = f64::from_le_bytes(field(bytes, 16));
        let count = u32::from_le_bytes(field(bytes, 32));
        let saying = match u16::from_le_bytes(field(bytes, 6)) {
            1 if count == PATCHES || count == VIEW => Saying::Ready(count),
            1 => return Err(format!("that it looks at {count} pictures, which must be {PATCHES} or {VIEW}")),
            2 => Saying::Target(value),
            3 => Saying::Step(value),
            kind => return Err(format!("an answer of kind {kind}, which must be 1, 2 or 3")),
        };

        let belief = if matches!(saying, Saying::Ready(_)) { 0 } else { count };
        if belief > MOST_BELIEF {
            return Err(format!("a belief of {belief} values, which may be {MOST_BELIEF} at most"));
        }

        Ok(Self {
            sequence: u64::from_le_bytes(field(bytes, 8)),
            saying,
            metric: f64::from_le_bytes(field(bytes, 24)),
            belief,
        })
    }
}

impl Saying {
    /// The focal power that it asks for, from `now`. A plain number, which its reader checks.
    pub fn target(self, now: FocalPower) -> Option<f64> {
        match self {
            Self::Ready(_) => None,
            Self::Target(target) => Some(target),
            Self::Step(step) if step.is_finite() => Some(now.moved(step).get()),
            Self::Step(step) => Some(step),
        }
    }
}

/// The bytes of a message at `place`; zeros past the end, which the check of the length excludes.
fn field<const N: usize>(bytes: &[u8], place: usize) -> [u8; N] {
    bytes.get(place..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer whose fields are written out by hand, as a C programmer would.
    fn answer(kind: u8, count: u8) -> Vec<u8> {
        let mut bytes = b"PFPO\x01\x00".to_vec();
        bytes.extend([kind, 0]);
        bytes.extend([7, 0, 0, 0, 0, 0, 0, 0]);
        bytes.extend(0.25f64.to_le_bytes());
        bytes.extend(f64::NAN.to_le_bytes());
        bytes.extend([count, 0, 0, 0, 0, 0, 0, 0]);
        bytes
    }

    #[test]
    fn an_answer_is_read_by_its_description() {
        let read = Answer::parse(&answer(2, 41)).unwrap();
        assert_eq!((read.sequence, read.saying, read.belief), (7, Saying::Target(0.25), 41));
        assert!(read.metric.is_nan());
        assert_eq!(Answer::parse(&answer(1, 3)).unwrap().saying, Saying::Ready(3));
        assert_eq!(Answer::parse(&answer(3, 0)).unwrap().saying.target(FocalPower::MIDDLE), Some(0.75));
    }

    #[test]
    fn everything_else_is_refused_with_what_is_wrong() {
        let refused = |bytes: &[u8]| Answer::parse(bytes).unwrap_err();
        assert_eq!(refused(b"hello\n"), "6 bytes where an answer has 40");
        assert_eq!(refused(&[b'x'; 40]), "bytes that do not begin with PFPO");
        assert!(refused(&answer(1, 2)).contains("2 pictures"));
        assert!(refused(&answer(9, 0)).contains("kind 9"));
        let mut newer = answer(2, 0);
        newer[4] = 2;
        assert!(refused(&newer).contains("version 2"));
        let mut long = answer(2, 0);
        long[33] = 0x20;
        assert!(refused(&long).contains("8192 values"));
    }

    #[test]
    fn a_question_has_its_fields_where_they_are_documented() {
        let question = Question {
            kind: Kind::Frame,
            sequence: 0x0102,
            focal_power: 0.5,
            time: 3,
            pictures: 3,
            side: 32,
            blur: f64::NAN,
        };
        let bytes = question.bytes();
        assert_eq!(bytes[..10], *b"PFPO\x01\x00\x03\x00\x02\x01");
        assert_eq!(bytes[16..24], 0.5f64.to_le_bytes());
        assert_eq!(bytes[24..52], *b"\x03\0\0\0\0\0\0\0\x03\0\0\0\x20\0\0\0\x20\0\0\0\0\0\0\0\0\x30\0\0");
    }
}
