//! Counts the tokens that the parser would find, without running it.
//!
//! Scans a text as libyaml does: a token, a quoted text and a block of text begin at the same
//! places, so that nothing can hide from the count. Where libyaml would stop with an error,
//! this scanner continues, which can only count more.
//! Source: `yaml_parser_fetch_next_token` of libyaml 0.2.5.

use super::{Cost, Limits, YamlError};

/// A key must be followed by its colon on the same line within this many characters.
const SIMPLE_KEY_MAX: usize = 1024;

pub(super) struct Scanner<'a> {
    text: &'a [u8],
    limits: &'a Limits,
    /// Index of a byte, and its position in characters.
    at: usize,
    line: usize,
    column: usize,
    characters: usize,
    cost: Cost,
    /// Brackets that are open.
    flow: usize,
    /// Columns of the lists and maps that are open by indentation.
    indents: Vec<usize>,
    /// Outside of brackets: whether a key may begin here, and the last place where one may.
    is_key_allowed: bool,
    key: Option<Key>,
}

#[derive(Clone, Copy)]
struct Key {
    line: usize,
    column: usize,
    characters: usize,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(text: &'a str, limits: &'a Limits) -> Self {
        Self {
            text: text.as_bytes(),
            limits,
            at: 0,
            line: 0,
            column: 0,
            characters: 0,
            cost: Cost::default(),
            flow: 0,
            indents: Vec::new(),
            is_key_allowed: true,
            key: None,
        }
    }

    pub(super) fn run(mut self) -> Result<Cost, YamlError> {
        loop {
            self.skip_to_token();
            if self.at == self.text.len() {
                return Ok(self.cost);
            }
            self.unroll();
            self.token()?;
        }
    }

    /// Scans one token of any kind.
    fn token(&mut self) -> Result<(), YamlError> {
        self.cost.tokens += 1;
        if self.cost.tokens > self.limits.tokens {
            return self.refuse(format_args!("more than {} tokens", self.limits.tokens));
        }
        let is_flow = self.flow > 0;
        if self.column == 0 && self.byte(0) == b'%' {
            self.begin_document();
            self.skip_line();
            return self.count_alias();
        }
        if self.is_document_mark() {
            self.begin_document();
            self.skip(3);
            return Ok(());
        }
        match self.byte(0) {
            b'[' | b'{' => {
                self.save_key();
                self.flow += 1;
                self.skip(1);
                return self.count_depth();
            }
            b']' | b'}' => {
                self.flow = self.flow.saturating_sub(1);
                self.is_key_allowed = false;
                self.skip(1);
            }
            b',' => {
                self.forget_key();
                self.is_key_allowed = true;
                self.skip(1);
            }
            mark @ (b'-' | b'?') if self.is_blank(1) || (mark == b'?' && is_flow) => {
                self.forget_key();
                self.is_key_allowed = true;
                let column = self.column;
                self.skip(1);
                return self.roll(column);
            }
            b':' if is_flow || self.is_blank(1) => {
                let key = self.valid_key();
                self.forget_key();
                self.is_key_allowed = !is_flow && key.is_none();
                let column = key.map_or(self.column, |key| key.column);
                self.skip(1);
                return self.roll(column);
            }
            mark @ (b'*' | b'&') => {
                self.begin_value();
                self.skip(1);
                while self.byte(0).is_ascii_alphanumeric() || matches!(self.byte(0), b'_' | b'-') {
                    self.skip(1);
                }
                if mark == b'*' {
                    return self.count_alias();
                }
            }
            b'!' => self.tag(),
            b'|' | b'>' if !is_flow => self.block_text(),
            b'\'' => self.single_quoted(),
            b'"' => self.double_quoted(),
            _ => self.plain(),
        }
        Ok(())
    }

    // Places.

    /// The byte `ahead` of the current one; 0 after the end.
    fn byte(&self, ahead: usize) -> u8 {
        self.text.get(self.at + ahead).copied().unwrap_or(0)
    }

    fn is_blank(&self, ahead: usize) -> bool {
        matches!(self.byte(ahead), b' ' | b'\t' | 0) || self.break_len(ahead) > 0
    }

    /// Bytes of the line break here: libyaml takes NEL, LS and PS as line breaks, too.
    fn break_len(&self, ahead: usize) -> usize {
        match (self.byte(ahead), self.byte(ahead + 1), self.byte(ahead + 2)) {
            (b'\r', b'\n', _) | (0xc2, 0x85, _) => 2,
            (b'\r' | b'\n', ..) => 1,
            (0xe2, 0x80, 0xa8 | 0xa9) => 3,
            _ => 0,
        }
    }

    fn is_end(&self) -> bool {
        self.at >= self.text.len()
    }

    /// Skips bytes, none of them in a line break.
    fn skip(&mut self, bytes: usize) {
        for _ in 0..bytes {
            // Only the first byte of a character counts as a character.
            let begins = !self.is_end() && self.text[self.at] & 0xc0 != 0x80;
            self.column += usize::from(begins);
            self.characters += usize::from(begins);
            self.at = (self.at + 1).min(self.text.len());
        }
    }

    fn skip_break(&mut self) {
        let bytes = self.break_len(0);
        self.characters += if self.text[self.at..].starts_with(b"\r\n") { 2 } else { 1 };
        self.at += bytes;
        self.line += 1;
        self.column = 0;
    }

    /// Skips to the end of the line, but not its break.
    fn skip_line(&mut self) {
        while !self.is_end() && self.break_len(0) == 0 {
            self.skip(1);
        }
    }

    fn skip_to_token(&mut self) {
        loop {
            if self.column == 0 && self.text[self.at..].starts_with(b"\xef\xbb\xbf") {
                // A byte order mark takes a column.
                self.skip(3);
            }
            // A null byte ends the text for libyaml; what follows costs nothing.
            while matches!(self.byte(0), b' ' | b'\t' | 0) && !self.is_end() {
                self.skip(1);
            }
            if self.byte(0) == b'#' {
                self.skip_line();
            }
            if self.is_end() || self.break_len(0) == 0 {
                return;
            }
            self.skip_break();
            if self.flow == 0 {
                self.is_key_allowed = true;
            }
        }
    }

    fn is_document_mark(&self) -> bool {
        let rest = &self.text[self.at..];
        self.column == 0
            && (rest.starts_with(b"---") || rest.starts_with(b"..."))
            && self.is_blank(3)
    }

    // Keys and indentation, which decide where a text over several lines ends.

    fn begin_document(&mut self) {
        self.indents.clear();
        self.forget_key();
        self.is_key_allowed = false;
    }

    fn begin_value(&mut self) {
        self.save_key();
        self.is_key_allowed = false;
    }

    fn save_key(&mut self) {
        if self.flow == 0 && self.is_key_allowed {
            let Self { line, column, characters, .. } = *self;
            self.key = Some(Key { line, column, characters });
        }
    }

    fn forget_key(&mut self) {
        if self.flow == 0 {
            self.key = None;
        }
    }

    fn valid_key(&self) -> Option<Key> {
        let is_near =
            |key: &Key| key.line == self.line && key.characters + SIMPLE_KEY_MAX >= self.characters;
        self.key.filter(|key| self.flow == 0 && is_near(key))
    }

    fn roll(&mut self, column: usize) -> Result<(), YamlError> {
        if self.flow == 0 && self.indents.last().is_none_or(|indent| *indent < column) {
            self.indents.push(column);
            return self.count_depth();
        }
        Ok(())
    }

    fn unroll(&mut self) {
        if self.flow == 0 {
            while self.indents.last().is_some_and(|indent| *indent > self.column) {
                self.indents.pop();
            }
        }
    }

    /// The lowest column that still belongs to the innermost list or map.
    fn indent(&self) -> usize {
        self.indents.last().map_or(0, |indent| indent + 1)
    }

    // Values.

    fn tag(&mut self) {
        self.begin_value();
        let is_verbatim = self.byte(1) == b'<';
        while !self.is_blank(0) && !self.is_end() {
            let byte = self.byte(0);
            if (is_verbatim && byte == b'>') || (!is_verbatim && self.flow > 0 && byte == b',') {
                break;
            }
            self.skip(1);
        }
        if is_verbatim && self.byte(0) == b'>' {
            self.skip(1);
        }
    }

    fn single_quoted(&mut self) {
        self.begin_value();
        self.skip(1);
        while !self.is_end() {
            match (self.byte(0), self.byte(1)) {
                (b'\'', b'\'') => self.skip(2),
                (b'\'', _) => return self.skip(1),
                _ => self.skip_any(),
            }
        }
    }

    fn double_quoted(&mut self) {
        self.begin_value();
        self.skip(1);
        while !self.is_end() {
            match self.byte(0) {
                b'"' => return self.skip(1),
                b'\\' => {
                    self.skip(1);
                    self.skip_any();
                }
                _ => self.skip_any(),
            }
        }
    }

    fn skip_any(&mut self) {
        if self.is_end() {
            return;
        }
        if self.break_len(0) > 0 { self.skip_break() } else { self.skip(1) }
    }

    fn plain(&mut self) {
        self.begin_value();
        let indent = self.indent();
        let start = self.at;
        while !self.is_document_mark() && self.byte(0) != b'#' {
            while !self.is_blank(0) {
                let byte = self.byte(0);
                let is_colon = byte == b':' && self.is_blank(1);
                let is_flow_mark = matches!(byte, b',' | b'[' | b']' | b'{' | b'}');
                if is_colon || (self.flow > 0 && is_flow_mark) {
                    break;
                }
                self.skip(1);
            }
            if self.is_end() || !self.is_blank(0) || self.byte(0) == 0 {
                break;
            }
            let mut has_break = false;
            while !self.is_end() && self.is_blank(0) && self.byte(0) != 0 {
                has_break |= self.break_len(0) > 0;
                self.skip_any();
            }
            self.is_key_allowed |= has_break;
            if self.flow == 0 && self.column < indent {
                break;
            }
        }
        if self.at == start {
            // No plain text begins here: libyaml stops with an error.
            self.skip_any();
        }
    }

    fn block_text(&mut self) {
        self.forget_key();
        self.is_key_allowed = true;
        self.skip(1);
        let mut given = None;
        while matches!(self.byte(0), b'+' | b'-' | b'1'..=b'9') {
            if self.byte(0).is_ascii_digit() {
                given = Some(usize::from(self.byte(0) - b'0'));
            }
            self.skip(1);
        }
        self.skip_line();
        if !self.is_end() {
            self.skip_break();
        }
        // An increment counts from the column of the list or map around it.
        let base = self.indents.last().copied().unwrap_or(0);
        let mut indent = given.map(|more| base + more);
        let mut widest = 0;
        loop {
            // Blank lines, and the indentation of the next one.
            loop {
                while indent.is_none_or(|indent| self.column < indent) && self.byte(0) == b' ' {
                    self.skip(1);
                }
                widest = widest.max(self.column);
                if self.is_end() || self.break_len(0) == 0 {
                    break;
                }
                self.skip_break();
            }
            let indent = *indent.get_or_insert(widest.max(self.indent()).max(1));
            if self.is_end() || self.column != indent || self.byte(0) == 0 {
                return;
            }
            self.skip_line();
            if !self.is_end() {
                self.skip_break();
            }
        }
    }

    // Limits.

    fn count_depth(&mut self) -> Result<(), YamlError> {
        let depth = self.flow + self.indents.len();
        self.cost.depth = self.cost.depth.max(depth);
        if depth > self.limits.depth {
            let most = self.limits.depth;
            return self.refuse(format_args!("lists and maps are nested more than {most} deep"));
        }
        Ok(())
    }

    fn count_alias(&mut self) -> Result<(), YamlError> {
        self.cost.aliases += 1;
        if self.cost.aliases > self.limits.aliases {
            return match self.limits.aliases {
                0 => self.refuse("aliases (*) and directives (%) are not supported here"),
                most => self.refuse(format_args!("more than {most} aliases (*) or directives (%)")),
            };
        }
        Ok(())
    }

    fn refuse<T>(&self, what: impl std::fmt::Display) -> Result<T, YamlError> {
        Err(YamlError {
            line: Some(self.line + 1),
            column: Some(self.column + 1),
            reason: what.to_string(),
        })
    }
}
