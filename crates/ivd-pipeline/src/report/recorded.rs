//! What records say, as text.

use ivd_report::shown;

use crate::StageRecord;

/// A parameter that a stage ran with.
pub(super) fn of_record(records: &[StageRecord], stage: &str, key: &str) -> String {
    let record = records.iter().find(|record| record.stage == stage && record.output.is_some());
    shown(record.and_then(|record| record.params.get(key)))
}

/// What was asked for, to the last digit, and what it is held beside.
pub(super) fn in_full(parts: [f64; 3]) -> String {
    parts.map(|part| format!("{}", (part * 1e4).round() / 1e4)).join(", ")
}
