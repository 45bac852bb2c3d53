//! The comparison as JUnit XML: a test case a gate.

use quick_junit::{NonSuccessKind, Report, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::report::DiffReport;
use crate::report::gate::Gate;
use crate::report::words::{in_unit, outcome, value};

/// The whole document.
///
/// # Errors
/// Those of the writer of XML.
pub fn text(report: &DiffReport) -> Result<String, SerializeError> {
    let mut suite = TestSuite::new("lightprobe diff-report");
    suite.add_test_cases(report.gates.iter().map(case));
    let mut document = Report::new("lightprobe diff-report");
    document.add_test_suite(suite);
    document.to_string()
}

fn case(gate: &Gate) -> TestCase {
    let message =
        format!("{}: {}, threshold {} ({})", gate.name, value(gate), in_unit(gate.threshold, gate.unit), gate.source);
    let status = match gate {
        _ if gate.fails() => {
            let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
            status.set_message(message).set_type(gate.name.clone()).set_description(gate.explanation.clone());
            status
        }
        _ if gate.waived || !gate.is_judged() => {
            let mut status = TestCaseStatus::skipped();
            status.set_message(format!("{}: {message}", outcome(gate)));
            status
        }
        _ => TestCaseStatus::success(),
    };
    let mut case = TestCase::new(gate.title(), status);
    case.set_classname(gate.name.clone());
    case
}
