//! The kinds of records that the chain has rows for: where each is kept, and which of its columns are hashed. Most
//! kinds have a table in exports, whose description says so of each column.

use std::sync::LazyLock;

use crate::store::export::description::{
    AccessRow, ActorRow, AnswerRow, CommentRow, ConsentRow, CorrectionRow, DeviceRow, ErasureRow, EventRow, RunRow,
    SessionRow, StudyEventRow, StudyRow, StudySessionRow, VoicePieceRow,
};
use crate::store::export::table::{Column, Proof, Row, Table, Type, means};

/// A kind of record.
#[derive(Debug)]
pub struct RecordKind {
    /// Its name, as in the chain.
    pub name: &'static str,
    /// Name of its table in exports.
    pub table: &'static str,
    /// The columns whose texts, divided by slashes, are a record's key.
    pub key: &'static [&'static str],
    /// Whether its records belong to sessions.
    pub of_session: bool,
    /// Columns that an export never withholds, in the order in which they are hashed.
    pub open: Vec<&'static str>,
    /// Columns that can be withheld or erased. They are hashed with a salt of their own.
    pub sealed: Vec<&'static str>,
    /// SQL that selects `chain_key`, `chain_session`, `chain_order` and every hashed column as exports have it.
    pub select: String,
    /// SQL condition that picks one record. The parts of its key are the parameters.
    pub one: String,
}

/// How a kind is kept in the database.
struct Kept {
    name: &'static str,
    /// Its table in exports.
    table: Table,
    /// Its table in the database.
    from: &'static str,
    of_session: bool,
    /// SQL expression that orders the records of a session as they are kept.
    order: &'static str,
    /// SQL of the columns that the database has in another form.
    sql: &'static [(&'static str, &'static str)],
    /// Hashed columns that the table in exports does not have.
    more: &'static [(&'static str, Proof)],
}

/// A kind that is kept as exports have it, in a table of the same name.
const fn kept(name: &'static str, table: Table) -> Kept {
    Kept { name, table, from: table.name, of_session: true, order: "number", sql: &[], more: &[] }
}

impl Kept {
    const fn outside_sessions(self) -> Self {
        Self { of_session: false, ..self }
    }

    fn kind(&self) -> RecordKind {
        let columns = || {
            let of_table = self.table.columns.iter().map(|column| (column.name, column.proof, column.kind));
            of_table.chain(self.more.iter().map(|&(name, proof)| (name, proof, Type::String)))
        };
        let hashed = |proof: Proof| -> Vec<&'static str> {
            columns().filter(move |column| column.1 == proof).map(|column| column.0).collect()
        };

        let selected = columns().filter(|column| column.1 != Proof::None).map(|(name, _, kind)| {
            match self.sql.iter().find(|(known, _)| *known == name) {
                Some((_, sql)) => format!("{sql} AS {name}"),
                None if kind == Type::Boolean => format!("iif({name}, 'true', 'false') AS {name}"),
                None => name.to_owned(),
            }
        });
        let selected: Vec<String> = selected.collect();

        let key: Vec<String> = self.table.key.iter().map(|column| format!("CAST({column} AS TEXT)")).collect();
        let one: Vec<String> = self.table.key.iter().map(|column| format!("{column} = ?")).collect();
        RecordKind {
            name: self.name,
            table: self.table.name,
            key: self.table.key,
            of_session: self.of_session,
            open: hashed(Proof::Open),
            sealed: hashed(Proof::Sealed),
            select: format!(
                "SELECT {} AS chain_key, {} AS chain_session, {} AS chain_order, {} FROM {}",
                key.join(" || '/' || "),
                if self.of_session { "session" } else { "NULL" },
                self.order,
                selected.join(", "),
                self.from,
            ),
            one: one.join(" AND "),
        }
    }
}

/// Participants. Of them an export has only the session's code.
const PARTICIPANTS: Table = Table {
    name: "participants",
    description: "",
    columns: &[hidden("code", Type::String), hidden("wall", Type::Datetime)],
    key: &["code"],
};

/// What happens to accounts, which no export has.
const ACCOUNT_EVENTS: Table = Table {
    name: "account_events",
    description: "",
    columns: &[
        hidden("number", Type::Integer),
        hidden("run", Type::Integer),
        hidden("wall", Type::Datetime),
        hidden("monotonic_ns", Type::Integer),
        hidden("account", Type::String),
        hidden("kind", Type::String),
        hidden("done_by", Type::String),
        hidden("detail", Type::String),
    ],
    key: &["number"],
};

const fn hidden(name: &'static str, kind: Type) -> Column {
    means("").open().column(name, kind)
}

/// Every kind except telemetry, which is chained in blocks.
const ALL: [Kept; 17] = [
    Kept {
        order: "run",
        more: &[("weights", Proof::Sealed), ("seed", Proof::Sealed)],
        ..kept("run", RunRow::TABLE).outside_sessions()
    },
    Kept { order: "0", ..kept("participant", PARTICIPANTS).outside_sessions() },
    Kept {
        order: "rowid",
        sql: &[(
            "segments",
            "(SELECT group_concat(segment, ',') FROM (
                 SELECT segment FROM segments AS g WHERE g.session = sessions.session ORDER BY setting))",
        )],
        more: &[("segments", Proof::Open)],
        ..kept("session", SessionRow::TABLE)
    },
    Kept {
        sql: &[
            // Two columns hold the kind of an event. If they differ, neither is believed.
            ("kind", "iif(kind IS payload ->> 'kind', kind, 'unclear')"),
            ("segment", "payload ->> 'segment'"),
            ("inspected_ms", "payload ->> 'inspected_ms'"),
            ("emergency", "CASE payload ->> 'emergency' WHEN 1 THEN 'true' WHEN 0 THEN 'false' END"),
            ("reason", "payload ->> 'reason'"),
            ("about", "payload ->> 'about'"),
            // As a text, to the last digit.
            ("focal_power", "payload -> 'focal_power'"),
            ("left_at", "payload -> 'left_at'"),
            ("hidden", "CASE payload ->> 'hidden' WHEN 1 THEN 'true' WHEN 0 THEN 'false' END"),
            ("picture_width", "payload ->> 'width'"),
            ("picture_height", "payload ->> 'height'"),
            ("pictures", "payload ->> 'pictures'"),
            ("over_ms", "payload ->> 'over_ms'"),
            ("frame", "payload -> 'frame'"),
            ("touched_x", "payload -> 'x'"),
            ("touched_y", "payload -> 'y'"),
            ("patch_across", "payload -> '$.place[0]'"),
            ("patch_down", "payload -> '$.place[1]'"),
        ],
        ..kept("event", EventRow::TABLE)
    },
    // SQLite's integers have a sign, so a very large frame number is kept as a negative one.
    Kept { sql: &[("frame", "iif(frame < 0, format('%u', frame), frame)")], ..kept("comment", CommentRow::TABLE) },
    Kept { sql: &[("given_value", "value")], ..kept("answer", AnswerRow::TABLE) },
    Kept { from: "device_events", ..kept("device", DeviceRow::TABLE).outside_sessions() },
    kept("access", AccessRow::TABLE),
    kept("correction", CorrectionRow::TABLE),
    kept("consent", ConsentRow::TABLE),
    kept(ERASED, ErasureRow::TABLE),
    Kept { order: "rowid", ..kept("study", StudyRow::TABLE).outside_sessions() },
    Kept {
        order: "0",
        sql: &[("about_session", "session")],
        ..kept("study-event", StudyEventRow::TABLE).outside_sessions()
    },
    Kept { order: "0", ..kept("study-session", StudySessionRow::TABLE) },
    kept("account-event", ACCOUNT_EVENTS).outside_sessions(),
    kept("actor", ActorRow::TABLE),
    // The sound itself is in none of the columns. Its hash is, and stays when the sound is erased.
    kept("voice-piece", VoicePieceRow::TABLE),
];

/// Every kind except telemetry.
pub fn kinds() -> &'static [RecordKind] {
    static KINDS: LazyLock<Vec<RecordKind>> = LazyLock::new(|| ALL.iter().map(Kept::kind).collect());
    &KINDS
}

/// The kind called `name`.
pub fn kind(name: &str) -> Option<&'static RecordKind> {
    kinds().iter().find(|kind| kind.name == name)
}

/// The kind of a block of telemetry: consecutive steps of a segment. Its key is `SEGMENT/FIRST/LAST`, counted from 1
/// within the segment.
pub const TELEMETRY: &str = "telemetry";

/// The kind of a record that says that the sealed columns of another one were erased.
pub const ERASED: &str = "erasure";

/// The kind of an event whose reason may name a policy.
pub const UNBLINDED: &str = "unblinded";
