//! The command of a policy's process: its words, its program, and what identifies it.

use std::env;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// Bytes of a file that are hashed at a time.
const PIECE: usize = 1 << 16;

/// A command whose program was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Command {
    /// The program and its arguments.
    pub words: Vec<String>,
    /// The program's file.
    program: PathBuf,
}

impl Command {
    /// Splits `text` into words as a shell does, and finds the program.
    ///
    /// # Errors
    /// If a quotation mark stays open, or there is no such program.
    pub fn parse(text: &str) -> Result<Self, String> {
        let Some(words) = shlex::split(text) else {
            return Err("a quotation mark in the command is never closed".to_owned());
        };
        let Some(name) = words.first() else {
            return Err("the command is empty; write exec:COMMAND".to_owned());
        };
        let program = find(name)?;
        Ok(Self { words, program })
    }

    /// SHA-256, in hexadecimal, of the files that the command names, one after another: the program, and every argument
    /// that is a file. `cat FILES | sha256sum` prints the same. `None` if one of them cannot be read.
    pub fn hash(&self) -> Option<String> {
        let mut hash = Sha256::new();
        add(&mut hash, &self.program).ok()?;

        let arguments = self.words.iter().skip(1).map(Path::new);
        for file in arguments.filter(|argument| argument.is_file()) {
            add(&mut hash, file).ok()?;
        }
        Some(hex::encode(hash.finalize()))
    }
}

/// The file of the program `name`: itself if it is a path, else the first of that name on the `PATH`.
fn find(name: &str) -> Result<PathBuf, String> {
    if name.contains('/') {
        let file = PathBuf::from(name);
        return match file.metadata() {
            Ok(_) if is_program(&file) => Ok(file),
            Ok(_) => {
                Err(format!("{name} is not a program; make the file executable, or name the program that runs it"))
            }
            Err(error) => Err(format!("there is no program {name}: {error}")),
        };
    }

    let path = env::var_os("PATH").unwrap_or_default();
    let found = env::split_paths(&path).map(|folder| folder.join(name)).find(|file| is_program(file));
    found.ok_or_else(|| format!("there is no program '{name}' on the PATH; give its full path"))
}

fn is_program(file: &Path) -> bool {
    file.metadata().is_ok_and(|about| about.is_file() && about.permissions().mode() & 0o111 != 0)
}

fn add(hash: &mut Sha256, file: &Path) -> io::Result<()> {
    let mut file = File::open(file)?;
    let mut piece = vec![0; PIECE];
    loop {
        match file.read(&mut piece)? {
            0 => return Ok(()),
            count => hash.update(&piece[..count]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_split_as_a_shell_does() {
        let command = Command::parse("sh -c 'echo  a' \"b c\" d\\ e").unwrap();
        assert_eq!(command.words, ["sh", "-c", "echo  a", "b c", "d e"]);
    }

    #[test]
    fn a_command_that_cannot_be_run_is_refused_with_a_sentence() {
        let refused = |text: &str| Command::parse(text).unwrap_err();
        assert!(refused("sh 'open").contains("never closed"));
        assert!(refused("  ").contains("the command is empty"));
        assert!(refused("no-such-program-here").contains("'no-such-program-here' on the PATH"));
        assert!(refused("/no/such/program").contains("there is no program /no/such/program"));
        assert!(refused("/dev/null").contains("is not a program"));
    }

    #[test]
    fn the_hash_is_that_of_its_files_one_after_another() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("program");
        std::fs::write(&program, "abc").unwrap();
        std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
        let text = |more: &str| format!("{} --option {more}", program.display());

        // SHA-256 of "abc", from FIPS 180-2.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(Command::parse(&text("")).unwrap().hash().unwrap(), abc);

        let part = folder.path().join("part");
        std::fs::write(&program, "a").unwrap();
        std::fs::write(&part, "bc").unwrap();
        assert_eq!(Command::parse(&text(&part.display().to_string())).unwrap().hash().unwrap(), abc);
    }
}
