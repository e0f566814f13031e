//! `virtual_axes interface`: topics, services and actions of the node, rejection codes and keys of /diagnostics.

use serde_json::{Value as Json, json};
use virtual_axes::ros_interface::diagnostics::{DIAGNOSTIC_KINDS, DiagnosticKind};
use virtual_axes::ros_interface::{
    ACTION_ERROR_CODES, ACTIONS, ActionErrorCode, NodeAction, NodeService, SERVICES, TOPICS, Topic,
    TopicDirection,
};
use virtual_axes_core::config::QosConfig;
use virtual_axes_core::text::wrapped;
use virtual_axes_core::trajectory::RejectionCode;

/// Largest length of a line.
const WIDTH: usize = 80;
/// Indentation of descriptions.
const INDENT: usize = 4;

/// Returns the interface as a JSON object.
pub fn json() -> String {
    let object = json!({
        "topics": TOPICS.iter().map(topic).collect::<Vec<_>>(),
        "services": SERVICES.iter().map(service).collect::<Vec<_>>(),
        "actions": ACTIONS.iter().map(action).collect::<Vec<_>>(),
        "action_error_codes": ACTION_ERROR_CODES.iter().map(error_code).collect::<Vec<_>>(),
        "rejection_codes": RejectionCode::ALL.iter().map(|&code| rejection_code(code)).collect::<Vec<_>>(),
        "diagnostics": DIAGNOSTIC_KINDS.iter().map(diagnostic_kind).collect::<Vec<_>>(),
    });
    format!("{object:#}\n")
}

fn direction(topic: &Topic) -> &'static str {
    match topic.direction {
        TopicDirection::In => "in",
        TopicDirection::Out => "out",
    }
}

fn reliability(qos: QosConfig) -> &'static str {
    if qos.is_reliable { "reliable" } else { "best_effort" }
}

fn durability(qos: QosConfig) -> &'static str {
    if qos.is_transient_local { "transient_local" } else { "volatile" }
}

fn topic(topic: &Topic) -> Json {
    let qos = topic.default_qos().map(|qos| {
        json!({
            "reliability": reliability(qos),
            "durability": durability(qos),
            "depth": qos.depth,
            "parameters": topic.qos_prefix(),
        })
    });
    let conditions = topic.conditions.iter().map(|(key, value)| json!({ "parameter": key, "value": value }));
    json!({
        "direction": direction(topic),
        "name": topic.name,
        "type": topic.type_name(),
        "content": topic.content,
        "qos": qos,
        "rate": topic.rate,
        "conditions": conditions.collect::<Vec<_>>(),
    })
}

fn service(service: &NodeService) -> Json {
    json!({ "name": service.name(), "type": service.type_name(), "content": service.content })
}

fn action(action: &NodeAction) -> Json {
    json!({
        "name": action.name,
        "type": action.type_name(),
        "content": action.content,
        "rate": action.rate,
    })
}

fn error_code(code: &ActionErrorCode) -> Json {
    json!({ "code": code.code, "name": code.name, "meaning": code.meaning })
}

fn rejection_code(code: RejectionCode) -> Json {
    json!({ "code": code as u8, "name": code.name(), "meaning": code.meaning() })
}

fn diagnostic_kind(kind: &DiagnosticKind) -> Json {
    let keys = kind
        .keys
        .iter()
        .map(|key| json!({ "key": key.key, "unit": key.unit, "description": key.description }));
    json!({ "status": kind.status, "keys": keys.collect::<Vec<_>>() })
}

/// Returns the interface as text of at most 80 columns.
pub fn text() -> String {
    let mut out = String::new();
    for (title, direction) in
        [("Subscribed topics", TopicDirection::In), ("Published topics", TopicDirection::Out)]
    {
        heading(&mut out, title);
        for topic in TOPICS.iter().filter(|topic| topic.direction == direction) {
            topic_text(&mut out, topic);
        }
    }
    heading(&mut out, "Services");
    for service in SERVICES {
        entry(&mut out, &format!("{}  {}", service.name(), service.type_name()), service.content);
    }
    heading(&mut out, "Actions");
    for action in ACTIONS {
        let content = format!("{}; {}", action.content, action.rate);
        entry(&mut out, &format!("{}  {}", action.name, action.type_name()), &content);
    }
    heading(&mut out, "Error codes of the action");
    for code in ACTION_ERROR_CODES {
        entry(&mut out, &format!("{} {}", code.code, code.name), code.meaning);
    }
    heading(&mut out, "Rejection codes of trajectories");
    for code in RejectionCode::ALL {
        entry(&mut out, &format!("{} {}", *code as u8, code.name()), code.meaning());
    }
    for kind in DIAGNOSTIC_KINDS {
        heading(&mut out, &format!("Keys of /diagnostics, status {}", kind.status));
        for key in kind.keys {
            let unit = if key.unit.is_empty() { String::new() } else { format!(", {}", key.unit) };
            entry(&mut out, &format!("{}{unit}", key.key), key.description);
        }
    }
    out
}

fn topic_text(out: &mut String, topic: &Topic) {
    let mut lines = vec![topic.content.to_owned(), format!("rate: {}", topic.rate)];
    lines.extend(topic.default_qos().map(|qos| {
        format!("QoS: {}, {}, keep last {}", reliability(qos), durability(qos), qos.depth).replace('_', " ")
    }));
    if !topic.conditions.is_empty() {
        let conditions: Vec<String> =
            topic.conditions.iter().map(|(key, value)| format!("{key}: {value}")).collect();
        lines.push(format!("only with {}", conditions.join(" or ")));
    }
    entry(out, &format!("{}  {}", topic.name, topic.type_name()), &lines.join("\n"));
}

fn heading(out: &mut String, title: &str) {
    if !out.is_empty() {
        out.push('\n');
    }
    out.push_str(title);
    out.push_str("\n\n");
}

/// Appends a name, and its indented description of one or more lines.
fn entry(out: &mut String, name: &str, description: &str) {
    out.push_str(&format!("{name}\n"));
    for line in description.lines().flat_map(|line| wrapped(line, WIDTH - INDENT)) {
        out.push_str(&format!("{:INDENT$}{line}\n", ""));
    }
}
