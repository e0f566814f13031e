//! Code of a line: upper case without blanks and comments, of any dialect.

/// Returns a line in upper case without blanks and comments.
pub(crate) fn code_of(line: &str) -> String {
    let mut code = String::with_capacity(line.len());
    let mut depth = 0_u32;
    for (at, letter) in line.char_indices() {
        match letter {
            ';' if depth == 0 => break,
            '/' if depth == 0 && line[at..].starts_with("//") => break,
            '(' => {
                // The parenthesis of a call remains.
                if depth == 0 && code.ends_with(|letter: char| letter.is_ascii_alphanumeric()) {
                    code.push('(');
                }
                depth += 1;
            }
            ')' => depth = depth.saturating_sub(1),
            _ if depth > 0 || letter.is_whitespace() => {}
            _ => code.push(letter),
        }
    }
    code
}

/// Returns true if a line in upper case without blanks has a word with its number.
pub(crate) fn has_word(code: &str, word: &str) -> bool {
    code.match_indices(word).any(|(at, _)| {
        !code[at + word.len()..].starts_with(|next: char| next.is_ascii_digit() || next == '.')
            && !code[..at].ends_with(|before: char| before.is_ascii_alphabetic())
    })
}
