//! Lines of Okuma programs, translated to those of macro B: names and common variables become parameters, names of lines
//! numbers.

use super::error::Outcome;
use super::limits::MAX_NESTING;

/// First parameter of the common variables VC.
const COMMON: usize = 50_000;
/// First parameter of the work offsets VZOFX …: 20 numbers for each system.
pub(super) const WORK_OFFSETS: usize = 60_000;
/// First number of lines with names.
const FIRST_NAME: u32 = 1_000_000_000;
/// Letters of a name of a line: digits, then letters; 0 is none.
const NAME_BASE: u32 = 37;
/// Longest name of a line, without its N.
const MAX_NAME: usize = 6;
/// Prefix of the parameters of variables.
pub(super) const PREFIX: &str = "_v_";
/// Words of the graphics, the output and the control without effect on the motion, at the start of a line.
const WITHOUT_EFFECT: [&[u8]; 8] = [b"draw", b"clear", b"def", b"msg", b"nomsg", b"pset", b"put", b"write"];
const FUNCTIONS: [&[u8]; 13] = [
    b"sin", b"cos", b"tan", b"asin", b"acos", b"atan", b"sqrt", b"abs", b"fix", b"fup", b"round", b"exp",
    b"ln",
];
const OPERATORS: [&[u8]; 10] = [b"eq", b"ne", b"lt", b"le", b"gt", b"ge", b"and", b"or", b"xor", b"mod"];
const AXES: &[u8] = b"xyzabcuvw";

/// Statement of a translated line.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum NamedStatement {
    /// CALL: name of the program, and the byte at which its arguments begin.
    Call(String, usize),
    /// MODIN: name of the program that each motion calls.
    ModalCall(String, usize),
    /// MODOUT.
    ModalEnd,
    /// RTS.
    Return,
    /// Word without effect on the motion.
    WithoutEffect(String),
}

/// Returns the statement of a translated line, if it has one.
pub(super) fn statement(text: &[u8]) -> Option<NamedStatement> {
    let named = |rest: &[u8], keyword: usize| {
        let end = rest.iter().position(|byte| *byte == b' ').unwrap_or(rest.len());
        (String::from_utf8_lossy(&rest[..end]).into_owned(), keyword + end)
    };
    if let Some(rest) = text.strip_prefix(b"call") {
        let (name, from) = named(rest, 4);
        return Some(NamedStatement::Call(name, from + 1));
    }
    if let Some(rest) = text.strip_prefix(b"modin") {
        let (name, from) = named(rest, 5);
        return Some(NamedStatement::ModalCall(name, from + 1));
    }
    match text {
        b"modout" => Some(NamedStatement::ModalEnd),
        b"rts" => Some(NamedStatement::Return),
        _ if WITHOUT_EFFECT.contains(&text) => {
            Some(NamedStatement::WithoutEffect(String::from_utf8_lossy(text).to_uppercase()))
        }
        _ => None,
    }
}

/// Replaces a line, in lower case without comments and with single blanks, by one of macro B. Returns the number of the
/// line.
pub(super) fn translate(line: &mut Vec<u8>) -> Outcome<Option<u32>> {
    let source = std::mem::take(line);
    let mut text = source.trim_ascii();
    let mut number = None;
    let first = token(text);
    let is_word = [&b"ncyl"[..], b"noex", b"nomsg"].iter().any(|word| first.starts_with(word));
    if first.first() == Some(&b'n') && !is_word {
        let digits = first[1..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let end = if digits > 0 { digits + 1 } else { first.len() };
        number = Some(line_number(&first[1..end])?);
        text = text[end..].trim_ascii_start();
    }
    let cycle_off = text.windows(4).position(|word| word == b"ncyl");
    let without;
    if let Some(at) = cycle_off {
        without = [&text[..at], &text[at + 4..]].concat();
        text = without.trim_ascii();
    }
    text = text.strip_prefix(b"noex").unwrap_or(text).trim_ascii_start();
    let first = token(text);
    let rest = text[first.len()..].trim_ascii_start();
    match first {
        b"rts" | b"modout" => line.extend_from_slice(first),
        b"call" | b"modin" => {
            let name = token(rest).strip_prefix(b"o").filter(|name| is_name(name));
            let name = name
                .ok_or_else(|| format!("{}: the name of a program is required, as in O100", shown(text)))?;
            line.extend_from_slice(first);
            line.extend_from_slice(name);
            line.push(b' ');
            words(&rest[name.len() + 1..], line)?;
        }
        _ if first.first() == Some(&b'o') && is_name(&first[1..]) => line.extend_from_slice(first),
        _ if WITHOUT_EFFECT.contains(&first) => line.extend_from_slice(first),
        _ if text.starts_with(b"put'") => line.extend_from_slice(b"put"),
        // The pattern of the canned cycle in effect.
        _ if text.starts_with(b"bhc") => {
            line.extend_from_slice(b"g70");
            words(&text[3..], line)?;
        }
        _ if text.starts_with(b"if") => condition(&text[2..], line)?,
        _ if text.starts_with(b"goto") => jump(&text[4..], line)?,
        _ => words(text, line)?,
    }
    if cycle_off.is_some() && !line.is_empty() {
        // The cycle takes effect with the next line.
        line.extend_from_slice(b"l0");
    }
    Ok(number)
}

/// Returns the axis whose upper travel limit is the variable `name`: `vpplz`.
pub(super) fn limit_axis(name: &str) -> Option<usize> {
    let [letter] = name.strip_prefix("vppl")?.as_bytes() else { return None };
    AXES.iter().position(|axis| axis == letter)
}

/// Returns the name of a line by its number.
pub(super) fn line_name(number: u32) -> String {
    let Some(mut rest) = number.checked_sub(FIRST_NAME) else { return number.to_string() };
    let mut name = Vec::new();
    while rest > 0 {
        let digit = (rest % NAME_BASE) as u8;
        name.push(if digit <= 10 { b'0' + digit - 1 } else { b'A' + digit - 11 });
        rest /= NAME_BASE;
    }
    name.reverse();
    String::from_utf8_lossy(&name).into_owned()
}

/// Returns the number of a line by its digits or name.
fn line_number(name: &[u8]) -> Outcome<u32> {
    let invalid = || format!("N{}: a line has a number or a name of 1 to {MAX_NAME} characters", shown(name));
    if !name.is_empty() && name.iter().all(u8::is_ascii_digit) {
        let number = str::from_utf8(name).ok().and_then(|digits| digits.parse().ok());
        return number.filter(|number| *number < FIRST_NAME).ok_or_else(invalid);
    }
    if name.is_empty() || name.len() > MAX_NAME || !name.iter().all(u8::is_ascii_alphanumeric) {
        return Err(invalid());
    }
    let packed = name.iter().fold(0, |packed, byte| {
        let digit =
            if byte.is_ascii_digit() { byte - b'0' + 1 } else { byte.to_ascii_lowercase() - b'a' + 11 };
        packed * NAME_BASE + u32::from(digit)
    });
    Ok(FIRST_NAME + packed)
}

/// Returns the text up to the first blank.
fn token(text: &[u8]) -> &[u8] {
    text.split(|byte| *byte == b' ').next().unwrap_or_default()
}

fn is_name(name: &[u8]) -> bool {
    !name.is_empty() && name.iter().all(u8::is_ascii_alphanumeric)
}

fn shown(text: &[u8]) -> String {
    String::from_utf8_lossy(&text[..text.len().min(40)]).to_uppercase()
}

/// Translates `[condition] N10`, also with GOTO.
fn condition(text: &[u8], out: &mut Vec<u8>) -> Outcome<()> {
    let text = text.trim_ascii_start();
    if text.first() != Some(&b'[') {
        return Err(format!(
            "{}: IF requires a condition in brackets and a line, as in IF [VC1 EQ 1] N10",
            shown(text)
        ));
    }
    out.extend_from_slice(b"if");
    let mut at = 0;
    bracket(text, &mut at, out, 0)?;
    let rest = text[at..].trim_ascii_start();
    jump(rest.strip_prefix(b"goto").unwrap_or(rest), out)
}

fn jump(text: &[u8], out: &mut Vec<u8>) -> Outcome<()> {
    let text = text.trim_ascii();
    let name =
        text.strip_prefix(b"n").ok_or_else(|| format!("{}: a line is required, as in N10", shown(text)))?;
    out.extend_from_slice(format!("goto{}", line_number(name)?).as_bytes());
    Ok(())
}

/// Translates words and settings: `X=VC1+2`, `XPOS=5`, `G56 HA`.
fn words(text: &[u8], out: &mut Vec<u8>) -> Outcome<()> {
    let mut at = 0;
    while let Some(&byte) = text.get(at) {
        if !byte.is_ascii_alphabetic() {
            at += 1;
            if byte != b' ' {
                out.push(byte);
            }
            continue;
        }
        let name = name_at(text, at);
        if name.len() == 1 || text[at..].iter().take_while(|byte| byte.is_ascii_alphabetic()).count() == 1 {
            out.push(byte);
            at += 1;
            if follows(text, at, b'=') {
                skip_assignment(text, &mut at);
                out.push(b'[');
                expression(text, &mut at, out, 0)?;
                out.push(b']');
            } else if text.get(at) == Some(&b'[') {
                bracket(text, &mut at, out, 0)?;
            }
            continue;
        }
        // The offset of the tool in the spindle.
        if matches!(name, b"ha" | b"hb" | b"hc" | b"da" | b"db" | b"dc") && !follows(text, at + 2, b'=') {
            out.push(byte);
            out.extend_from_slice(b"#4120");
            at += 2;
            continue;
        }
        setting(text, &mut at, out)?;
    }
    Ok(())
}

/// Translates `XPOS=5` and `VZOFZ[1]=VZOFZ[1]+2`. An array without assignment has no effect.
fn setting(text: &[u8], at: &mut usize, out: &mut Vec<u8>) -> Outcome<()> {
    let (start, length) = (*at, out.len());
    variable(text, at, out, 0)?;
    let is_array = text[start..*at].contains(&b'[');
    if !follows(text, *at, b'=') {
        out.truncate(length);
        return match is_array {
            true => Ok(()),
            false => Err(format!(
                "{} is not supported in the dialect okuma: program its motions",
                shown(&text[start..*at])
            )),
        };
    }
    skip_assignment(text, at);
    if follows(text, *at, b'\'') {
        // A text for the operator.
        *at = text.len();
        out.truncate(length);
        return Ok(());
    }
    out.push(b'=');
    expression(text, at, out, 0)
}

/// Moves behind the `=` that follows.
fn skip_assignment(text: &[u8], at: &mut usize) {
    while text[*at] != b'=' {
        *at += 1;
    }
    *at += 1;
}

/// Returns true if `byte` is next, after blanks.
fn follows(text: &[u8], at: usize, byte: u8) -> bool {
    text.get(at..).is_some_and(|rest| rest.trim_ascii_start().first() == Some(&byte))
}

/// Returns the letters at `at` with the letters and digits after them; of an operator, or VC, its part.
fn name_at(text: &[u8], at: usize) -> &[u8] {
    let rest = &text[at..];
    let letters = rest.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    let name = rest.iter().take_while(|byte| byte.is_ascii_alphanumeric()).count();
    let digits = rest[letters..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    match &rest[..letters] {
        operator if OPERATORS.contains(&operator) || operator == b"eor" => &rest[..letters],
        b"vc" => &rest[..letters + digits],
        _ => &rest[..name],
    }
}

/// Translates an expression up to a blank outside of brackets at which no operator stands.
fn expression(text: &[u8], at: &mut usize, out: &mut Vec<u8>, depth: usize) -> Outcome<()> {
    let is_operator = |byte: &u8| matches!(byte, b'+' | b'-' | b'*' | b'/' | b'=');
    while let Some(&byte) = text.get(*at) {
        match byte {
            b' ' => {
                let joins = text[..*at].last().is_some_and(is_operator)
                    || text[*at..].trim_ascii_start().first().is_some_and(is_operator);
                if depth == 0 && !joins {
                    return Ok(());
                }
                *at += 1;
            }
            b'[' => bracket(text, at, out, depth)?,
            b']' => return Ok(()),
            b'a'..=b'z' => operand(text, at, out, depth)?,
            b'#' => hexadecimal(text, at, out)?,
            _ => {
                out.push(byte);
                *at += 1;
            }
        }
    }
    Ok(())
}

/// Translates a hexadecimal number: `#81H`.
fn hexadecimal(text: &[u8], at: &mut usize, out: &mut Vec<u8>) -> Outcome<()> {
    let length = text[*at + 1..].iter().take_while(|byte| byte.is_ascii_alphanumeric()).count();
    let number = &text[*at..*at + 1 + length];
    let digits = str::from_utf8(&number[1..]).ok().and_then(|digits| digits.strip_suffix('h'));
    let value = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let value =
        value.ok_or_else(|| format!("{}: a hexadecimal number is required, as in #81H", shown(number)))?;
    out.extend_from_slice(value.to_string().as_bytes());
    *at += number.len();
    Ok(())
}

/// Translates an expression in brackets.
fn bracket(text: &[u8], at: &mut usize, out: &mut Vec<u8>, depth: usize) -> Outcome<()> {
    if depth >= MAX_NESTING {
        return Err(format!("expression nested more than {MAX_NESTING} levels deep"));
    }
    out.push(b'[');
    *at += 1;
    expression(text, at, out, depth + 1)?;
    if text.get(*at) != Some(&b']') {
        return Err("expression without closing bracket".to_owned());
    }
    *at += 1;
    out.push(b']');
    Ok(())
}

/// Translates a function, an operator or a variable.
fn operand(text: &[u8], at: &mut usize, out: &mut Vec<u8>, depth: usize) -> Outcome<()> {
    let name = name_at(text, *at);
    let translated: &[u8] = match name {
        b"eor" => b"xor",
        b"atan2" => b"atan",
        _ if OPERATORS.contains(&name) => name,
        _ if FUNCTIONS.contains(&name) && follows(text, *at + name.len(), b'[') => name,
        _ => return variable(text, at, out, depth),
    };
    out.extend_from_slice(translated);
    *at += name.len();
    Ok(())
}

/// Translates a variable, with its index.
fn variable(text: &[u8], at: &mut usize, out: &mut Vec<u8>, depth: usize) -> Outcome<()> {
    let name = name_at(text, *at);
    *at += name.len();
    let number =
        name.strip_prefix(b"vc").and_then(|digits| str::from_utf8(digits).ok()?.parse::<usize>().ok());
    if let Some(number) = number {
        out.extend_from_slice(format!("#{}", COMMON + number.min(WORK_OFFSETS - COMMON - 1)).as_bytes());
        return Ok(());
    }
    if name == b"vtlcn" || name == b"empty" {
        out.extend_from_slice(if name == b"empty" { b"#0" } else { b"#4120" });
        return Ok(());
    }
    // An output that raises an alarm.
    if name == b"vdout" && text[*at..].starts_with(b"[992]") {
        *at += 5;
        out.extend_from_slice(b"#3000");
        return Ok(());
    }
    if text.get(*at) == Some(&b'[') {
        let axis = name.strip_prefix(b"vzof").filter(|axis| axis.len() == 1);
        let axis = axis.and_then(|axis| AXES.iter().position(|letter| *letter == axis[0]));
        let start = match (name, axis) {
            (b"vc", _) => Some(format!("#[{COMMON}+")),
            (b"vtofh", _) => Some("#[11000+".to_owned()),
            (b"vtofd", _) => Some("#[13000+".to_owned()),
            (_, Some(axis)) => Some(format!("#[{}+20*", WORK_OFFSETS + axis)),
            _ => None,
        };
        if let Some(start) = start {
            out.extend_from_slice(start.as_bytes());
            bracket(text, at, out, depth)?;
            out.push(b']');
            return Ok(());
        }
        // Other arrays of the control have one value.
        let length = out.len();
        bracket(text, at, out, depth)?;
        out.truncate(length);
    }
    out.extend_from_slice(b"#<");
    out.extend_from_slice(PREFIX.as_bytes());
    out.extend_from_slice(name);
    out.push(b'>');
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn translated(text: &str) -> (String, Option<u32>) {
        let mut line = text.to_ascii_lowercase().into_bytes();
        let number = translate(&mut line).unwrap();
        (String::from_utf8(line).unwrap(), number)
    }

    #[test]
    fn lines_become_those_of_macro_b() {
        for (text, expected) in [
            ("G0 X=XPOS-45 Y=VC2 M3", "g0x[#<_v_xpos>-45]y[#50002]m3"),
            ("VC[VC1+1] = VZOFZ[2] + 5", "#[50000+[#50001+1]]=#[60002+20*[2]]+5"),
            ("NCYL G81 Z=ZP-2 R3 M54", "g81z[#<_v_zp>-2]r3m54l0"),
            ("G56 HA Z100", "g56h#4120z100"),
            ("G1 X = -1.0 F = VC1", "g1x[-1.0]f[#50001]"),
            ("BHC X=XPOS Y5 I35 J45 K4", "g70x[#<_v_xpos>]y5i35j45k4"),
            ("PUT 'EVENT=1 '", "put"),
            ("PUT VC5,6,0", "put"),
            ("G15 H=VC32", "g15h[#50032]"),
            ("IF [ VTLCN EQ 5 ] N25", "if[#4120eq5]goto25"),
            ("IF [VC1EQ2] GOTO N7", "if[#50001eq2]goto7"),
            ("CALL O100 PX=2 Q3", "call100 #<_v_px>=2q3"),
            ("CALL OO88", "callo88 "),
            ("X=SIN[A1]*2 G1", "x[sin[#<_v_a1>]*2]g1"),
            ("M143 VSLNO=1", "m143#<_v_vslno>=1"),
            ("VSLDT[1,30]", ""),
            ("NCYLG81Z-2R3", "g81z-2r3l0"),
            ("G81 Z-2 R3 NCYL", "g81z-2r3l0"),
            ("IF [PX NE EMPTY] NXT1", "if[#<_v_px>ne#0]goto1000047658"),
            ("VDOUT[992]=1004", "#3000=1004"),
            ("VDOUT[6]=1", "#<_v_vdout>=1"),
            ("VFST=#81H", "#<_v_vfst>=129"),
            ("VUACM[1]='NO DATA \"PX\"'", ""),
            ("OSTRT", "ostrt"),
        ] {
            assert_eq!(translated(text).0, expected, "{text}");
        }
        let (text, number) = translated("NXT2 T2");
        assert_eq!(text, "t2");
        assert_eq!(number.map(line_name).as_deref(), Some("XT2"));
        assert_eq!(translated("N100G0").1, Some(100));
        assert!(translate(&mut b"laa x0 y0 i25".to_vec()).is_err());
    }
}
