//! Puts a page's script and all that it imports into one module, so that a browser asks once for it. On a distant
//! server each request more costs a round trip, and modules that import modules cost one for each step.
//!
//! The scripts in `web/static` import and export in few ways, one statement a line, which biome keeps them to. Nothing
//! else is understood here, and a test puts every page's script together.

use std::collections::BTreeMap;
use std::fmt::Write;

/// The one module of the script `entry`. `source` gives the text of a script by its folder and name.
///
/// # Errors
/// A sentence, if a script is missing, if scripts import each other in a circle, or if a statement is not understood.
pub fn bundle(entry: &str, source: &impl Fn(&str) -> Option<&'static str>) -> Result<String, String> {
    let mut bundle = Bundle { source, state: BTreeMap::new(), text: String::new() };
    bundle.add(entry)?;
    Ok(bundle.text)
}

/// Whether a script is in the bundle, or is being put into it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Begun,
    Done,
}

struct Bundle<'a, F> {
    source: &'a F,
    state: BTreeMap<String, State>,
    text: String,
}

impl<F: Fn(&str) -> Option<&'static str>> Bundle<'_, F> {
    /// Adds the script `name` after those that it imports, as the constant whose members are its exports.
    fn add(&mut self, name: &str) -> Result<(), String> {
        match self.state.get(name) {
            Some(State::Begun) => return Err(format!("{name} imports itself, through others")),
            Some(State::Done) => return Ok(()),
            None => self.state.insert(name.to_owned(), State::Begun),
        };

        let source = (self.source)(name).ok_or_else(|| format!("{name} is missing"))?;
        let module = Module::read(name, source)?;
        for import in &module.imports {
            self.add(&import.from)?;
        }
        self.write(name, &module);
        self.state.insert(name.to_owned(), State::Done);
        Ok(())
    }

    fn write(&mut self, name: &str, module: &Module) {
        // Writing to a string does not fail.
        let _ = writeln!(self.text, "// {name}\nconst {} = (() => {{", constant(name));
        for import in module.imports.iter().filter(|import| !import.names.is_empty()) {
            let names = import.names.replace(" as ", ": ");
            let _ = writeln!(self.text, "const {{ {names} }} = {};", constant(&import.from));
        }
        let _ = writeln!(self.text, "{}return {{ {} }};\n}})();", module.body, module.exports.join(", "));
    }
}

/// The constant that holds the exports of script `name`.
fn constant(name: &str) -> String {
    let letters = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
    format!("${}", name.trim_end_matches(".js").chars().map(letters).collect::<String>())
}

/// An import statement: what is imported, as it is written, and from which script.
struct Import {
    names: String,
    from: String,
}

/// A script, taken apart.
struct Module {
    imports: Vec<Import>,
    exports: Vec<String>,
    body: String,
}

impl Module {
    fn read(name: &str, source: &str) -> Result<Self, String> {
        let mut module = Self { imports: Vec::new(), exports: Vec::new(), body: String::new() };
        let mut lines = source.lines();
        while let Some(line) = lines.next() {
            let start = line.trim_start();
            if start.starts_with("//") {
                continue;
            }
            if start.starts_with("/*") {
                // Types and headings are for those who read and check the sources.
                let mut last = line;
                let code = loop {
                    if let Some((_, code)) = last.split_once("*/") {
                        break code;
                    }
                    last = lines.next().ok_or_else(|| format!("{name}: a comment has no end"))?;
                };
                if !code.trim().is_empty() {
                    module.body.push_str(code);
                    module.body.push('\n');
                }
                continue;
            }

            if line.matches('`').count() % 2 == 1 {
                return Err(format!("{name}: a text of several lines would lose its indentation: {line}"));
            }
            if line.starts_with("import ") {
                let mut statement = line.to_owned();
                while !statement.ends_with(';') {
                    let next = lines.next().ok_or_else(|| format!("{name}: an import has no end"))?;
                    statement.push(' ');
                    statement.push_str(next.trim());
                }
                module.imports.push(import(name, &statement)?);
            } else if let Some(declaration) = line.strip_prefix("export ") {
                module.exports.push(exported(name, declaration)?);
                module.body.push_str(declaration);
                module.body.push('\n');
            } else if !start.is_empty() {
                // A twentieth of what browsers get would be indentation, even compressed.
                module.body.push_str(start);
                module.body.push('\n');
            }
        }
        Ok(module)
    }
}

/// Reads a statement such as `import { a, b as c } from "../shared/dom.js";` of script `name`.
fn import(name: &str, statement: &str) -> Result<Import, String> {
    let unknown = || format!("{name}: this import is not understood: {statement}");
    let (before, after) = statement.split_once('"').ok_or_else(unknown)?;
    let path = after.strip_suffix("\";").ok_or_else(unknown)?;
    let names = match before.trim() {
        "import" => "",
        names => names.strip_prefix("import {").and_then(|names| names.strip_suffix("} from")).ok_or_else(unknown)?,
    };

    let (folder, _) = name.split_once('/').ok_or_else(unknown)?;
    let from = match (path.strip_prefix("./"), path.strip_prefix("../")) {
        (Some(beside), _) => format!("{folder}/{beside}"),
        (_, Some(other)) => other.to_owned(),
        _ => return Err(unknown()),
    };
    Ok(Import { names: names.trim().trim_end_matches(',').to_owned(), from })
}

/// The name that a declaration after `export` declares.
fn exported(name: &str, declaration: &str) -> Result<String, String> {
    let keywords = ["const ", "function ", "async function ", "class "];
    let declared = keywords.iter().find_map(|keyword| declaration.strip_prefix(keyword));
    let of_name = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == '$';
    declared
        .map(|declared| declared.chars().take_while(|letter| of_name(*letter)).collect::<String>())
        .filter(|declared| !declared.is_empty())
        .ok_or_else(|| format!("{name}: this export is not understood: {declaration}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(name: &str) -> Option<&'static str> {
        Some(match name {
            "surgeon/page.js" => {
                "// The page.\nimport \"../shared/side.js\";\nimport {\n  add,\n  one as first,\n} from \"./sums.js\";\n\
                 import { twice } from \"../shared/twice.js\";\n\n/** What it says. */\nsay(\n  /** @type {number} */ (twice(add(first, 2))),\n);\n"
            }
            "surgeon/sums.js" => {
                "import { twice } from \"../shared/twice.js\";\n/**\n * @param {number} a\n */\n\
                 export function add(a, b) {\n  // Twice and half.\n  return twice(a + b) / 2;\n}\nexport const one = 1;\n"
            }
            "shared/twice.js" => "export const twice = (n) => 2 * n;\nconst hidden = \"// kept\";\n",
            "shared/side.js" => "say(\"first\");\n",
            "shared/circle.js" => "import { b } from \"./back.js\";\nexport const a = b;\n",
            "shared/back.js" => "import { a } from \"./circle.js\";\nexport const b = a;\n",
            "shared/odd.js" => "export default 1;\n",
            "shared/long.js" => "export const text = `one\n  two`;\n",
            _ => return None,
        })
    }

    #[test]
    fn scripts_come_once_each_after_those_that_they_import_and_without_comments() {
        let expected = "\
// shared/side.js
const $shared_side = (() => {
say(\"first\");
return {  };
})();
// shared/twice.js
const $shared_twice = (() => {
const twice = (n) => 2 * n;
const hidden = \"// kept\";
return { twice };
})();
// surgeon/sums.js
const $surgeon_sums = (() => {
const { twice } = $shared_twice;
function add(a, b) {
return twice(a + b) / 2;
}
const one = 1;
return { add, one };
})();
// surgeon/page.js
const $surgeon_page = (() => {
const { add, one: first } = $surgeon_sums;
const { twice } = $shared_twice;
say(
 (twice(add(first, 2))),
);
return {  };
})();
";
        assert_eq!(bundle("surgeon/page.js", &files).unwrap(), expected);
    }

    #[test]
    fn what_is_not_understood_is_said() {
        let said = |entry| bundle(entry, &files).unwrap_err();
        assert_eq!(said("shared/circle.js"), "shared/circle.js imports itself, through others");
        assert_eq!(said("shared/none.js"), "shared/none.js is missing");
        assert!(said("shared/odd.js").contains("not understood"));
        assert!(said("shared/long.js").contains("would lose its indentation"));
    }
}
