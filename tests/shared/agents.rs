//! Folders of agents as `tools/rl` leaves them (`tests/golden/make_agents.py`).

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

/// The runs, and what SciPy and rliable find in them.
pub fn fixture() -> Value {
    serde_json::from_str(include_str!("../golden/agents.json")).expect("JSON")
}

/// Writes the folder of a complete run.
pub fn write_agent(folder: &Path, config: &Value, log: &[Value]) {
    fs::create_dir_all(folder).expect("a folder");
    let lines: String = log.iter().map(|line| format!("{line}\n")).collect();
    let steps = log.last().map_or(&Value::Null, |line| &line["step"]);
    let summary = json!({ "interrupted": false, "steps": steps, "seconds": 9.0 });
    for (name, text) in [
        ("config.json", config.to_string()),
        ("log.jsonl", lines),
        ("summary.json", summary.to_string()),
        ("model.zip", "networks".to_owned()),
    ] {
        fs::write(folder.join(name), text).expect("written");
    }
}

/// Writes every run of the fixture.
pub fn write_agents(folder: &Path) {
    for (name, run) in fixture()["runs"].as_object().expect("runs") {
        let log = run["log"].as_array().expect("a log");
        write_agent(&folder.join(name), &run["config"], log);
    }
}
