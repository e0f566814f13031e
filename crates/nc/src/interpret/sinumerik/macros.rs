//! Macros: DEFINE NAME AS text.

use std::collections::BTreeMap;

use super::super::error::Outcome;
use super::super::limits::{MAX_LINE, MAX_NAMED};
use super::scanner::BlockScanner;

/// Deepest nesting of macros.
const MAX_DEPTH: usize = 8;

/// Macros by name.
#[derive(Debug, Default)]
pub(super) struct Macros(BTreeMap<String, Vec<u8>>);

impl Macros {
    /// Adds the macro of `NAME AS text`.
    pub(super) fn define(&mut self, scanner: &mut BlockScanner<'_>) -> Outcome<()> {
        let name = scanner.name()?.to_owned();
        if !scanner.skip_name("AS") {
            return Err(format!("{}: DEFINE requires AS, as in DEFINE COOLANT AS M8", scanner.rest()));
        }
        if self.0.len() >= MAX_NAMED {
            return Err(format!("the program has more than {MAX_NAMED} macros"));
        }
        self.0.insert(name, scanner.take_rest().trim_ascii().to_vec());
        Ok(())
    }

    /// Replaces the names of macros in a block by their texts.
    pub(super) fn expand(&self, text: &mut Vec<u8>) -> Outcome<()> {
        if self.0.is_empty() || text.starts_with(b"DEFINE") {
            return Ok(());
        }
        for _ in 0..MAX_DEPTH {
            match self.expand_once(text)? {
                Some(expanded) => *text = expanded,
                None => return Ok(()),
            }
        }
        Err(format!("macros are nested more than {MAX_DEPTH} levels deep"))
    }

    /// Returns the text with the macros in it replaced once; `None` without one.
    fn expand_once(&self, text: &[u8]) -> Outcome<Option<Vec<u8>>> {
        let mut expanded = Vec::new();
        let (mut at, mut is_changed, mut in_string) = (0, false, false);
        while let Some(&byte) = text.get(at) {
            in_string ^= byte == b'"';
            let length = match byte {
                b'A'..=b'Z' | b'_' if !in_string => text[at..]
                    .iter()
                    .take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'_')
                    .count(),
                _ => 1,
            };
            let word = &text[at..at + length];
            match std::str::from_utf8(word).ok().and_then(|name| self.0.get(name)) {
                Some(replacement) => {
                    expanded.extend_from_slice(replacement);
                    is_changed = true;
                }
                None => expanded.extend_from_slice(word),
            }
            at += length;
            if expanded.len() > MAX_LINE {
                return Err(format!("the block is longer than {MAX_LINE} bytes with its macros"));
            }
        }
        Ok(is_changed.then_some(expanded))
    }
}
