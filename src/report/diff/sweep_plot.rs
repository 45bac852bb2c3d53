//! Error against bake time of two sweeps in one picture.

use minijinja::context;
use serde_json::Value;

use super::figures::join;
use crate::report::plot::{Chart, Mark, Series};

/// Relative errors are drawn in percent.
const PERCENT: f64 = 100.0;

/// The ladders of both sides; `None` where no configuration has both time and error.
pub(super) fn plot(item: &str, base: &Value, candidate: &Value) -> Option<minijinja::Value> {
    let series: Vec<Series> =
        [(base, "base"), (candidate, "candidate")].iter().flat_map(|(report, side)| ladders(report, side)).collect();
    if series.iter().all(|series| series.marks.is_empty()) {
        return None;
    }
    let title = join(item, "error against bake time");
    let chart = Chart {
        title: "Error against bake time, base and candidate".to_owned(),
        note: "bars from least to most of the seeds; filled: on the front of its ladder".to_owned(),
        x_label: "bake time (s)".to_owned(),
        y_label: "rmse of indirect irradiance ÷ mean (%)".to_owned(),
        series,
        guides: Vec::new(),
    };
    Some(context! { title, svg => chart.svg() })
}

fn ladders(report: &Value, side: &str) -> Vec<Series> {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let configurations = list(&report["configurations"]);
    let ladder = |ladder: &Value| {
        let front = list(&ladder["fronts"]["bake_s"]);
        let places = list(&ladder["configurations"]);
        let marks = places.iter().filter_map(|index| {
            let configuration = configurations.get(usize::try_from(index.as_u64()?).ok()?)?;
            Some(Mark { on_front: front.contains(index), ..mark(configuration)? })
        });
        let name = format!("{}, {side}", ladder["name"].as_str().unwrap_or("ladder"));
        Series { name, marks: marks.collect() }
    };
    list(&report["ladders"]).iter().map(ladder).collect()
}

fn mark(configuration: &Value) -> Option<Mark> {
    let along = |figure: &str, factor: f64| {
        let of = |part: &str| Some(factor * configuration["figures"][figure][part].as_f64()?);
        let mean = of("mean")?;
        Some((mean, [of("min").unwrap_or(mean), of("max").unwrap_or(mean)]))
    };
    let ((x, x_bar), (y, y_bar)) = (along("bake_s", 1.0)?, along("error_relative", PERCENT)?);
    Some(Mark { x, y, x_bar, y_bar, on_front: false })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn both_sides_are_in_one_picture() {
        let sweep = |error: f64| {
            let one = |time: f64| {
                let figures = json!({"bake_s": {"mean": time, "min": time, "max": 2.0 * time},
                                     "error_relative": {"mean": error, "min": error, "max": error}});
                json!({"label": "x", "figures": figures})
            };
            let ladder = json!({"name": "moments", "configurations": [0, 1, 7], "fronts": {"bake_s": [1]}});
            json!({"configurations": [one(1.0), one(4.0)], "ladders": [ladder]})
        };
        let found = ladders(&sweep(0.02), "base");
        assert_eq!((found.len(), found[0].marks.len(), found[0].name.as_str()), (1, 2, "moments, base"));
        let mark = found[0].marks[1];
        assert_eq!((mark.x, mark.y, mark.x_bar, mark.y_bar, mark.on_front), (4.0, 2.0, [4.0, 8.0], [2.0, 2.0], true));
        let plot = plot("", &sweep(0.02), &sweep(0.03)).unwrap();
        let svg = plot.get_attr("svg").unwrap().to_string();
        assert!(svg.contains("moments, base") && svg.contains("moments, candidate"));
        assert!(super::plot("", &json!({}), &json!({"configurations": []})).is_none());
    }
}
