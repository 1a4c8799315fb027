//! Inputs made from seeds by small changes, one after another, as fuzzers make them. The same number gives the same
//! inputs.

use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

/// Most changes to one seed.
const MOST_CHANGES: usize = 6;
/// Longest input in bytes, so that none grows without end.
const LONGEST: usize = 64 * 1024;

/// Tokens that often break parsers: limits of numbers, signs, separators, invalid UTF-8, deep nesting.
const TOKENS: [&[u8]; 26] = [
    b"0",
    b"-1",
    b"65535",
    b"2147483648",
    b"4294967296",
    b"9223372036854775807",
    b"18446744073709551616",
    b"1e309",
    b"-1e-320",
    b"nan",
    b"inf",
    b"null",
    b"true",
    b"\"",
    b"'",
    b"\\u0000",
    b"\0",
    b"\r\n",
    b"\n",
    b",",
    b"[[[[",
    b"{}",
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x00",
    b"\xed\xa0\x80",
    "\u{fe0f}\u{1f600}".as_bytes(),
];

/// Makes inputs from seeds.
pub struct Mutator<'a> {
    random: ChaCha12Rng,
    seeds: &'a [Vec<u8>],
}

impl<'a> Mutator<'a> {
    /// A mutator that makes the inputs of number `number`: it seeds the random source.
    pub fn new(number: u64, seeds: &'a [Vec<u8>]) -> Self {
        Self { random: ChaCha12Rng::seed_from_u64(number), seeds }
    }

    /// The next input.
    pub fn next_input(&mut self) -> Vec<u8> {
        let mut input = self.seed().to_vec();
        for _ in 0..self.random.random_range(1..=MOST_CHANGES) {
            self.change(&mut input);
        }
        input.truncate(LONGEST);
        input
    }

    fn seed(&mut self) -> &'a [u8] {
        self.seeds.choose(&mut self.random).expect("there is a seed")
    }

    fn change(&mut self, input: &mut Vec<u8>) {
        let at = self.random.random_range(0..=input.len());
        let rest = input.len() - at;
        let length = self.random.random_range(0..=rest.min(32));

        match self.random.random_range(0..9) {
            0 if rest > 0 => input[at] ^= 1 << self.random.random_range(0..8),
            1 if rest > 0 => input[at] = self.random.random(),
            2 => {
                input.drain(at..at + length);
            }
            3 => {
                let copy = input[at..at + length].to_vec();
                let to = self.random.random_range(0..=input.len());
                input.splice(to..to, copy);
            }
            4 => {
                let token = *TOKENS.choose(&mut self.random).expect("there are tokens");
                input.splice(at..at + length.min(token.len()), token.iter().copied());
            }
            5 => self.number(input, at),
            6 => input.truncate(at),
            7 => {
                // The rest of another seed, or of the same one from another place.
                let other = self.seed();
                let from = self.random.random_range(0..=other.len());
                let end = (from + self.random.random_range(0..256)).min(other.len());
                input.splice(at..at + length, other[from..end].iter().copied());
            }
            _ => input.insert(at, self.random.random()),
        }
    }

    /// Replaces the decimal number at or after `at`, if there is one, by another.
    fn number(&mut self, input: &mut Vec<u8>, at: usize) {
        let Some(begin) = input[at..].iter().position(u8::is_ascii_digit).map(|offset| at + offset) else { return };
        let digits = input[begin..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number: i64 = if self.random.random() { self.random.random_range(-3..300) } else { self.random.random() };
        input.splice(begin..begin + digits, number.to_string().into_bytes());
    }
}
