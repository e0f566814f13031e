//! Parameters of a program: numbered, and named with local or global scope.

use std::collections::HashMap;

use super::dialect::Dialect;
use super::error::Outcome;
use super::limits::MAX_NAMED;

/// First number of the parameters of the control, which the program reads only.
pub(super) const FIRST_OF_CONTROL: usize = 5000;
/// Largest number of a parameter.
const LAST: usize = 5602;
/// Last number of a variable of macro B.
const LAST_VARIABLE: usize = 999_999;
/// First variable of macro B that belongs to the control.
pub(super) const FIRST_VARIABLE_OF_CONTROL: usize = 1000;
/// Largest number of arguments of a subprogram; of macro B, which has more local variables than LinuxCNC.
pub(super) const LOCALS: usize = 33;
/// Number of numbered parameters that are local to a subprogram of LinuxCNC, from 1.
const LINUXCNC_LOCALS: usize = 30;
/// Largest number of variables of the control that a program sets.
const MAX_SET: usize = 100_000;
/// Tolerance on integers, as LinuxCNC has it.
const INTEGER: f64 = 1e-4;

/// Values set by the program.
#[derive(Debug)]
pub(super) struct ParameterValues {
    /// Values from #0 on; NaN is a variable of macro B without value.
    numbered: Vec<f64>,
    /// Variables of the control that the program has set.
    of_control: HashMap<usize, f64>,
    /// Number of local parameters of a subprogram.
    locals: usize,
    global: HashMap<String, f64>,
    local: HashMap<String, f64>,
    /// Number of named parameters in `global`, `local` and the saved scopes.
    names: usize,
}

/// Local parameters of a calling program.
#[derive(Debug)]
pub(super) struct CallerScope {
    numbered: Vec<f64>,
    named: HashMap<String, f64>,
}

impl ParameterValues {
    pub(super) fn new(dialect: Dialect) -> Self {
        let (initial, locals) =
            if dialect.has_macro_b() { (f64::NAN, LOCALS) } else { (0.0, LINUXCNC_LOCALS) };
        let numbered = vec![initial; FIRST_OF_CONTROL];
        Self {
            numbered,
            of_control: HashMap::new(),
            locals,
            global: HashMap::new(),
            local: HashMap::new(),
            names: 0,
        }
    }

    /// Returns the value of a numbered parameter below those of the control.
    pub(super) fn numbered(&self, number: usize) -> Option<f64> {
        self.numbered.get(number).copied()
    }

    /// Returns the value of a variable of the control that the program has set.
    pub(super) fn of_control(&self, number: usize) -> Option<f64> {
        self.of_control.get(&number).copied()
    }

    /// Sets a variable of the control without further effect.
    pub(super) fn set_of_control(&mut self, number: usize, value: f64) -> Outcome<()> {
        if self.of_control.len() >= MAX_SET && !self.of_control.contains_key(&number) {
            return Err(format!("#{number}: the program sets more than {MAX_SET} variables of the control"));
        }
        self.of_control.insert(number, value);
        Ok(())
    }

    /// Returns the value of a named parameter.
    pub(super) fn named(&self, name: &str) -> Option<f64> {
        self.scope(name).get(name).copied()
    }

    fn scope(&self, name: &str) -> &HashMap<String, f64> {
        if name.starts_with('_') { &self.global } else { &self.local }
    }

    /// Sets a numbered parameter.
    pub(super) fn set_numbered(&mut self, number: usize, value: f64) -> Outcome<()> {
        let last = FIRST_OF_CONTROL - 1;
        let parameter = self.numbered.get_mut(number);
        *parameter.ok_or_else(|| format!("#{number}: read only; #1 to #{last} can be set"))? = value;
        Ok(())
    }

    /// Sets a named parameter.
    pub(super) fn set_named(&mut self, name: &str, value: f64) -> Outcome<()> {
        let scope = if name.starts_with('_') { &mut self.global } else { &mut self.local };
        if let Some(known) = scope.get_mut(name) {
            *known = value;
            return Ok(());
        }
        if self.names >= MAX_NAMED {
            return Err(format!("#<{name}>: the program has more than {MAX_NAMED} named parameters"));
        }
        self.names += 1;
        scope.insert(name.to_owned(), value);
        Ok(())
    }

    /// Starts the scope of a subprogram with arguments, and returns the scope of its caller.
    pub(super) fn enter(&mut self, arguments: &[f64; LOCALS]) -> CallerScope {
        let locals = &mut self.numbered[1..=self.locals];
        let numbered = locals.to_vec();
        locals.copy_from_slice(&arguments[..self.locals]);
        CallerScope { numbered, named: std::mem::take(&mut self.local) }
    }

    /// Ends the scope of a subprogram.
    pub(super) fn leave(&mut self, caller: CallerScope) {
        self.names -= self.local.len();
        self.local = caller.named;
        self.numbered[1..=self.locals].copy_from_slice(&caller.numbered);
    }
}

/// Returns a value as an integer from 0.
pub(super) fn integer(value: f64) -> Option<u32> {
    let rounded = value.round();
    ((value - rounded).abs() < INTEGER && (0.0..=f64::from(u32::MAX)).contains(&rounded))
        .then_some(rounded as u32)
}

/// Returns the number of a parameter.
pub(super) fn parameter_number(value: f64, dialect: Dialect) -> Outcome<usize> {
    let numbers = if dialect.has_macro_b() { 0..=LAST_VARIABLE } else { 1..=LAST };
    let number = integer(value).map(|number| number as usize).filter(|number| numbers.contains(number));
    number.ok_or_else(|| {
        format!("#{value}: the number of a parameter is {} to {}", numbers.start(), numbers.end())
    })
}
