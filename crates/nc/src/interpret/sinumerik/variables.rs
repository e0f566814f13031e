//! Variables of a program: R parameters, DEF, values of calls, and global user data.

use std::collections::HashMap;

use super::super::error::Outcome;
use super::super::limits::MAX_NAMED;
use super::value::{Kind, ProgramValue};

/// Largest number of an R parameter.
const LAST_R: usize = 9999;
/// Largest number of values of all arrays.
const MAX_ELEMENTS: usize = 200_000;
/// Constants of the cycles.
const CONSTANTS: [(&str, f64); 10] = [
    ("_OFF", 0.0),
    ("_FINISH", 1.0),
    ("_SEMIFIN", 2.0),
    ("_ROUGH", 3.0),
    ("_PRECISION", 4.0),
    ("_ORI_FINISH", 11.0),
    ("_ORI_SEMIFIN", 12.0),
    ("_ORI_ROUGH", 13.0),
    ("_ORI_PRECISION", 14.0),
    ("_TOP_SURFACE_SMOOTH_ON", 1.0),
];

/// Variable with its elements.
#[derive(Debug, Clone)]
struct Variable {
    kind: Kind,
    /// Size of each dimension; empty without index.
    dimensions: Vec<usize>,
    elements: Vec<ProgramValue>,
}

/// Variable that a name refers to.
#[derive(Debug, Clone)]
pub(super) enum VariableReference {
    /// R parameter.
    R(usize),
    /// Variable of a call level, or one element of it.
    Variable { level: usize, name: String, element: Option<usize> },
}

#[derive(Debug)]
enum Entry {
    Own(Variable),
    /// VAR parameter.
    Alias(VariableReference),
}

/// Variables of the program and of its calls.
#[derive(Debug)]
pub(super) struct Variables {
    r: Vec<f64>,
    /// Variables of each call level; the first is that of the main program.
    levels: Vec<HashMap<String, Entry>>,
    /// Global user data, which the program sets without DEF.
    global: HashMap<String, ProgramValue>,
    names: usize,
    elements: usize,
}

impl Variables {
    pub(super) fn new() -> Self {
        Self { r: Vec::new(), levels: vec![HashMap::new()], global: HashMap::new(), names: 0, elements: 0 }
    }

    /// Starts the variables of a subprogram.
    pub(super) fn enter(&mut self) {
        self.levels.push(HashMap::new());
    }

    /// Ends the variables of a subprogram.
    pub(super) fn leave(&mut self) {
        if self.levels.len() > 1
            && let Some(level) = self.levels.pop()
        {
            self.names -= level.len();
            let own = level.values().map(|entry| match entry {
                Entry::Own(variable) => variable.elements.len(),
                Entry::Alias(_) => 0,
            });
            self.elements -= own.sum::<usize>();
        }
    }

    /// Defines a variable (DEF) with the sizes of its dimensions.
    pub(super) fn define(&mut self, kind: Kind, name: &str, dimensions: Vec<usize>) -> Outcome<()> {
        let count = dimensions.iter().try_fold(1_usize, |count, size| count.checked_mul(*size));
        let count = count.filter(|count| *count > 0 && self.elements + count <= MAX_ELEMENTS);
        let count = count.ok_or_else(|| format!("{name}: arrays may have {MAX_ELEMENTS} values in all"))?;
        if let Some(Entry::Own(old)) = self.levels.last().and_then(|level| level.get(name)) {
            // A loop or jump passes the definition again.
            self.elements -= old.elements.len();
            self.names -= 1;
        }
        self.insert(name, Entry::Own(Variable { kind, dimensions, elements: vec![kind.initial(); count] }))?;
        self.elements += count;
        Ok(())
    }

    /// Defines a VAR parameter of the present level.
    pub(super) fn define_alias(&mut self, name: &str, target: VariableReference) -> Outcome<()> {
        self.insert(name, Entry::Alias(target))
    }

    fn insert(&mut self, name: &str, entry: Entry) -> Outcome<()> {
        if self.names >= MAX_NAMED {
            return Err(format!("{name}: the program has more than {MAX_NAMED} variables"));
        }
        self.names += 1;
        if let Some(level) = self.levels.last_mut() {
            level.insert(name.to_owned(), entry);
        }
        Ok(())
    }

    /// Returns true if the name is a variable of the program.
    pub(super) fn is_defined(&self, name: &str) -> bool {
        self.find(name).is_some() || self.global.contains_key(name)
    }

    /// Returns the level and entry of a name: in the present level, then in the main program.
    fn find(&self, name: &str) -> Option<(usize, &Entry)> {
        let last = self.levels.len() - 1;
        [last, 0].into_iter().find_map(|level| Some((level, self.levels[level].get(name)?)))
    }

    /// Returns what a name refers to; `None` if it is not defined.
    pub(super) fn reference(
        &self,
        name: &str,
        indices: &[ProgramValue],
    ) -> Outcome<Option<VariableReference>> {
        if let Some(number) = r_number(name, indices)? {
            return Ok(Some(VariableReference::R(number)));
        }
        let Some((level, entry)) = self.find(name) else { return Ok(None) };
        Ok(Some(match entry {
            Entry::Own(variable) => {
                let element = match indices {
                    [] => None,
                    indices => Some(variable.element(name, indices)?),
                };
                VariableReference::Variable { level, name: name.to_owned(), element }
            }
            Entry::Alias(target) => match (target, indices) {
                (target, []) => target.clone(),
                (VariableReference::Variable { level, name: own, element: None }, indices) => {
                    let element = self.own(*level, own).map(|variable| variable.element(name, indices));
                    VariableReference::Variable {
                        level: *level,
                        name: own.clone(),
                        element: element.transpose()?,
                    }
                }
                _ => return Err(format!("{name} has no index: it is one value of the caller")),
            },
        }))
    }

    fn own(&self, level: usize, name: &str) -> Option<&Variable> {
        match self.levels.get(level)?.get(name)? {
            Entry::Own(variable) => Some(variable),
            Entry::Alias(_) => None,
        }
    }

    /// Returns the value of a variable.
    pub(super) fn value(&self, name: &str, indices: &[ProgramValue]) -> Outcome<Option<ProgramValue>> {
        // Most values are R parameters or single variables.
        if indices.is_empty()
            && let Some((_, Entry::Own(variable))) = self.find(name)
            && variable.dimensions.is_empty()
        {
            return Ok(variable.elements.first().cloned());
        }
        Ok(match self.reference(name, indices)? {
            Some(VariableReference::R(number)) => {
                Some(ProgramValue::Number(self.r.get(number).copied().unwrap_or(0.0)))
            }
            Some(VariableReference::Variable { level, name: own, element }) => {
                let Some(variable) = self.own(level, &own) else { return Ok(None) };
                if element.is_none() && !variable.dimensions.is_empty() {
                    return Err(format!("{name}: an array requires an index, as {name}[0]"));
                }
                variable.elements.get(element.unwrap_or(0)).cloned()
            }
            None => {
                let constant = CONSTANTS.iter().find(|(constant, _)| *constant == name);
                self.global.get(name).cloned().or(constant.map(|(_, value)| ProgramValue::Number(*value)))
            }
        })
    }

    /// Sets a variable. A name without DEF becomes global user data; returns true the first time.
    pub(super) fn set(&mut self, name: &str, indices: &[ProgramValue], value: ProgramValue) -> Outcome<bool> {
        match self.reference(name, indices)? {
            Some(VariableReference::R(number)) => {
                if number >= self.r.len() {
                    self.r.resize(number + 1, 0.0);
                }
                self.r[number] = value.number().map_err(|reason| format!("R{number}: {reason}"))?;
                Ok(false)
            }
            Some(VariableReference::Variable { level, name: own, element }) => {
                if let Some(Entry::Own(variable)) =
                    self.levels.get_mut(level).and_then(|level| level.get_mut(&own))
                {
                    let value = variable.kind.convert(value).map_err(|reason| format!("{name}: {reason}"))?;
                    match element {
                        Some(element) => variable.elements[element] = value,
                        None => variable.elements.fill(value),
                    }
                }
                Ok(false)
            }
            None => {
                if !indices.is_empty() {
                    return Err(format!(
                        "{name}[…] is not declared: add DEF REAL {name}[…] at the program start"
                    ));
                }
                if self.global.len() >= MAX_NAMED {
                    return Err(format!("{name}: the program has more than {MAX_NAMED} variables"));
                }
                Ok(self.global.insert(name.to_owned(), value).is_none())
            }
        }
    }

    /// Sets the elements of an array in their order, from an index on.
    pub(super) fn set_list(&mut self, name: &str, values: Vec<ProgramValue>) -> Outcome<()> {
        let Some((level, Entry::Own(_))) = self.find(name) else {
            return Err(format!("{name} is not an array of this program"));
        };
        if let Some(Entry::Own(variable)) = self.levels[level].get_mut(name) {
            for (element, value) in variable.elements.iter_mut().zip(values) {
                *element = variable.kind.convert(value)?;
            }
        }
        Ok(())
    }
}

impl Variable {
    /// Returns the position of an element.
    fn element(&self, name: &str, indices: &[ProgramValue]) -> Outcome<usize> {
        if indices.len() != self.dimensions.len() {
            return Err(format!("{name} has {} indices, found {}", self.dimensions.len(), indices.len()));
        }
        let mut element = 0;
        for (index, size) in indices.iter().zip(&self.dimensions) {
            let number = match index {
                ProgramValue::Axis(axis) => *axis as f64,
                value => value.clone().number()?.round(),
            };
            if !(0.0..*size as f64).contains(&number) {
                return Err(format!("{name}[{number}]: the index must be between 0 and {}", size - 1));
            }
            element = element * size + number as usize;
        }
        Ok(element)
    }
}

/// Returns the number of an R parameter: R5, R[5].
fn r_number(name: &str, indices: &[ProgramValue]) -> Outcome<Option<usize>> {
    let Some(digits) = name.strip_prefix('R') else { return Ok(None) };
    let number = match (digits, indices) {
        ("", [index]) => index.clone().number()?.round(),
        ("", _) => return Ok(None),
        (digits, []) if digits.bytes().all(|byte| byte.is_ascii_digit()) => {
            digits.parse::<f64>().unwrap_or(f64::INFINITY)
        }
        _ => return Ok(None),
    };
    match (0.0..=LAST_R as f64).contains(&number) {
        true => Ok(Some(number as usize)),
        false => Err(format!("R{number}: the number of an R parameter must be between 0 and {LAST_R}")),
    }
}
