//! The words of a usda text: names, numbers, strings, assets, paths and signs.

use crate::raw::Scene;
use luxproof_spec::SpecError;

/// A word of the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token<'a> {
    /// A name or a keyword, with its namespaces.
    Word(&'a str),
    Number(f64),
    /// A string without its quotes.
    Text(String),
    /// `@file.ies@`
    Asset(String),
    /// `</World/Mesh>`
    Path(String),
    Sign(char),
    End,
}

/// The words of a text, one after the other.
pub(super) struct Words<'a> {
    scene: &'a Scene<'a>,
    text: &'a str,
    /// Bytes that were read.
    at: usize,
    line: usize,
}

impl<'a> Words<'a> {
    pub(super) fn new(scene: &'a Scene<'a>, text: &'a str) -> Self {
        Self { scene, text, at: 0, line: 1 }
    }

    /// The line of what was read last.
    pub(super) fn line(&self) -> usize {
        self.line
    }

    pub(super) fn next(&mut self) -> Result<Token<'a>, SpecError> {
        self.skip_blanks()?;
        let rest = &self.text[self.at..];
        let Some(first) = rest.chars().next() else { return Ok(Token::End) };
        match first {
            '"' | '\'' => self.string(first),
            '@' => {
                let mark = if rest.starts_with("@@@") { "@@@" } else { "@" };
                Ok(Token::Asset(self.enclosed(mark, mark)?.to_owned()))
            }
            '<' => Ok(Token::Path(self.enclosed("<", ">")?.to_owned())),
            '0'..='9' | '+' | '-' | '.' => self.number(),
            'a'..='z' | 'A'..='Z' | '_' => Ok(self.name()),
            _ => {
                self.at += first.len_utf8();
                Ok(Token::Sign(first))
            }
        }
    }

    /// Takes a sign if it is next.
    pub(super) fn takes(&mut self, sign: char) -> Result<bool, SpecError> {
        self.skip_blanks()?;
        let is_next = self.text[self.at..].starts_with(sign);
        self.at += if is_next { sign.len_utf8() } else { 0 };
        Ok(is_next)
    }

    pub(super) fn expect(&mut self, sign: char) -> Result<(), SpecError> {
        if self.takes(sign)? { Ok(()) } else { Err(self.fault(&format!("`{sign}` is expected here"))) }
    }

    pub(super) fn word(&mut self) -> Result<&'a str, SpecError> {
        match self.next()? {
            Token::Word(word) => Ok(word),
            _ => Err(self.fault("a name is expected here")),
        }
    }

    fn skip_blanks(&mut self) -> Result<(), SpecError> {
        loop {
            let rest = &self.text.as_bytes()[self.at..];
            match rest {
                [b'\n', ..] => {
                    self.line += 1;
                    self.at += 1;
                }
                [b' ' | b'\t' | b'\r', ..] => self.at += 1,
                [b'#', ..] | [b'/', b'/', ..] => {
                    self.at += rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
                }
                [b'/', b'*', ..] => {
                    self.enclosed("/*", "*/")?;
                }
                _ => return Ok(()),
            }
        }
    }

    /// What stands between two marks, of which the first is next.
    fn enclosed(&mut self, open: &str, close: &str) -> Result<&'a str, SpecError> {
        let inner = &self.text[self.at + open.len()..];
        let Some(length) = inner.find(close) else {
            return Err(self.fault(&format!("`{open}` has no end")));
        };
        let inner = &inner[..length];
        self.line += inner.bytes().filter(|byte| *byte == b'\n').count();
        self.at += open.len() + length + close.len();
        Ok(inner)
    }

    /// A string in one or three quotes; a backslash keeps the next character.
    fn string(&mut self, quote: char) -> Result<Token<'a>, SpecError> {
        let three = [quote; 3].iter().collect::<String>();
        let is_long = self.text[self.at..].starts_with(&three);
        self.at += if is_long { 3 } else { 1 };
        let mut text = String::new();
        let mut chars = self.text[self.at..].char_indices();
        while let Some((k, char)) = chars.next() {
            let is_end = if is_long { self.text[self.at + k..].starts_with(&three) } else { char == quote };
            if is_end {
                self.at += k + if is_long { 3 } else { 1 };
                return Ok(Token::Text(text));
            }
            match char {
                '\\' => text.extend(chars.next().map(|(_, next)| next)),
                '\n' if !is_long => break,
                '\n' => {
                    self.line += 1;
                    text.push(char);
                }
                _ => text.push(char),
            }
        }
        Err(self.fault("a string has no end"))
    }

    fn number(&mut self) -> Result<Token<'a>, SpecError> {
        let rest = &self.text[self.at..];
        let length =
            rest.find(|c: char| !(c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'))).unwrap_or(rest.len());
        match rest[..length].parse() {
            Ok(number) => {
                self.at += length;
                Ok(Token::Number(number))
            }
            Err(_) => Err(self.fault("this is no number")),
        }
    }

    fn name(&mut self) -> Token<'a> {
        let rest = &self.text[self.at..];
        let length =
            rest.find(|c: char| !(c.is_ascii_alphanumeric() || matches!(c, '_' | ':' | '.'))).unwrap_or(rest.len());
        self.at += length;
        match &rest[..length] {
            "inf" => Token::Number(f64::INFINITY),
            "nan" => Token::Number(f64::NAN),
            name => Token::Word(name),
        }
    }

    fn fault(&self, message: &str) -> SpecError {
        self.scene.fault(Some(self.line), message, "the file is broken: export it again")
    }
}
