//! Looks at what was joined before it is scored: units, counting, a constant lag, axes, positions
//! that mean "not found", objects that do not move.
//!
//! Nothing is changed. A [`Finding`] says what looks wrong, how much that rests on, and what would
//! remedy it; whoever shows it offers that as an option or a button. What a person said themselves
//! ([`Ground::Said`](crate::data::Ground::Said)) is not questioned.

mod axes;
mod blocks;
mod counting;
mod finding;
mod lag;
mod still;
mod subject;
mod unit;
mod zeros;

pub use finding::{Evidence, Finding, Problem, Remedy, Side};
pub use subject::Subject;

use blocks::Blocks;

/// What looks wrong, the worst first; nothing where all looks right.
pub fn examine(subject: &Subject) -> Vec<Finding> {
    let blocks = Blocks::of(subject);
    let mut findings = unit::examine(subject, &blocks);
    findings.extend(counting::examine(subject, &blocks));
    // A lag of one frame is how counting from 1 shows.
    let is_aligned = !findings.iter().any(|f| f.problem == Problem::Counting);
    if is_aligned {
        findings.extend(lag::examine(subject, &blocks));
    }
    findings.extend(axes::examine(subject, &blocks));
    findings.extend(zeros::examine(subject));
    findings.extend(still::examine(subject));
    findings
}
