//! What programs write, as threads read it, so that neither side can block the other; never more of it in memory than is asked for.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use parking_lot::Mutex;

/// How long a pipe may stay open after the program behind it has ended.
const LEFT_BEHIND: Duration = Duration::from_secs(3);
/// Bytes of a program's messages that are kept from their beginning, and as many from their end.
const KEPT: usize = 256 << 10;
/// Lines of an answer that wait to be read: a program that says more waits, too.
const WAITING: usize = 64;
/// Bytes that are read at a time.
const PIECE: usize = 1 << 16;

/// The beginning and the end of what is said.
#[derive(Debug, Default)]
struct Ends {
    first: Vec<u8>,
    last: VecDeque<u8>,
    left_out: u64,
}

impl Ends {
    fn push(&mut self, piece: &[u8]) {
        let (first, rest) = piece.split_at(piece.len().min(KEPT - self.first.len()));
        self.first.extend(first);
        self.last.extend(rest);
        let surplus = self.last.len().saturating_sub(KEPT);
        self.last.drain(..surplus);
        self.left_out += surplus as u64;
    }

    fn text(self) -> String {
        let between =
            if self.left_out > 0 { format!("\n[... {} bytes left out ...]\n", self.left_out) } else { String::new() };
        let bytes = [self.first, between.into_bytes(), self.last.into()].concat();
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// A program's messages, the middle of very many left out.
#[derive(Debug)]
pub(super) struct Messages {
    ends: Arc<Mutex<Ends>>,
    closed: mpsc::Receiver<()>,
}

impl Messages {
    pub(super) fn of(pipe: Option<impl Read + Send + 'static>) -> Self {
        let ends = Arc::new(Mutex::new(Ends::default()));
        let kept = Arc::clone(&ends);
        let closed = drain(pipe, move |piece| {
            kept.lock().push(piece);
            true
        });
        Self { ends, closed }
    }

    /// What was said, once the program has ended.
    pub(super) fn into_text(self) -> String {
        wait_for(&self.closed);
        self.so_far()
    }

    /// What was said since this was asked last.
    pub(super) fn so_far(&self) -> String {
        std::mem::take(&mut *self.ends.lock()).text()
    }
}

/// A program's answer, which ends where it grows beyond what is asked for.
#[derive(Debug)]
pub(super) struct Answer {
    bytes: Arc<Mutex<Vec<u8>>>,
    is_too_long: Arc<AtomicBool>,
    closed: mpsc::Receiver<()>,
}

impl Answer {
    pub(super) fn of(pipe: Option<impl Read + Send + 'static>, most: usize) -> Self {
        let (bytes, is_too_long) = (Arc::new(Mutex::new(vec![])), Arc::new(AtomicBool::new(false)));
        let (kept, mark) = (Arc::clone(&bytes), Arc::clone(&is_too_long));
        let closed = drain(pipe, move |piece| {
            let mut kept = kept.lock();
            let fits = kept.len() + piece.len() <= most;
            if fits {
                kept.extend(piece);
            }
            mark.store(!fits, Ordering::Relaxed);
            fits
        });
        Self { bytes, is_too_long, closed }
    }

    pub(super) fn is_too_long(&self) -> bool {
        self.is_too_long.load(Ordering::Relaxed)
    }

    /// All of it, once the program has ended.
    pub(super) fn given(self) -> Vec<u8> {
        wait_for(&self.closed);
        std::mem::take(&mut *self.bytes.lock())
    }
}

/// The lines of an answer, as they come; they end with the pipe, with a line that is longer than `most`, or when nobody listens.
pub(super) fn lines(pipe: Option<impl Read + Send + 'static>, most: usize) -> mpsc::Receiver<String> {
    let (sender, lines) = mpsc::sync_channel(WAITING);
    thread::spawn(move || {
        let Some(pipe) = pipe else { return };
        let mut pipe = BufReader::new(pipe);
        while let Some(line) = line(&mut pipe, most)
            && sender.send(line).is_ok()
        {}
    });
    lines
}

fn line(pipe: &mut impl BufRead, most: usize) -> Option<String> {
    let mut line = vec![];
    pipe.take(most as u64).read_until(b'\n', &mut line).ok()?;
    let text = String::from_utf8(line).ok()?;
    let is_whole = text.ends_with('\n') || (!text.is_empty() && text.len() < most);
    is_whole.then(|| text.trim_end_matches(['\n', '\r']).to_owned())
}

/// Reads a pipe to its end, or until `take` has enough; what is returned hears of it.
fn drain(
    pipe: Option<impl Read + Send + 'static>,
    mut take: impl FnMut(&[u8]) -> bool + Send + 'static,
) -> mpsc::Receiver<()> {
    let (open, closed) = mpsc::channel();
    thread::spawn(move || {
        let _open: mpsc::Sender<()> = open;
        let Some(mut pipe) = pipe else { return };
        let mut buffer = vec![0; PIECE];
        loop {
            match pipe.read(&mut buffer) {
                Ok(0) => return,
                Ok(count) if !take(&buffer[..count]) => return,
                Err(error) if error.kind() != std::io::ErrorKind::Interrupted => {
                    return tracing::warn!(%error, "output of a program cut short");
                }
                _ => (),
            }
        }
    });
    closed
}

/// Something that a program without a supervisor left behind may hold its pipe open for ever.
fn wait_for(closed: &mpsc::Receiver<()>) {
    if closed.recv_timeout(LEFT_BEHIND) == Err(mpsc::RecvTimeoutError::Timeout) {
        tracing::warn!("a program left something behind that holds its output open: what it said so far counts");
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    #[test]
    fn of_very_many_messages_the_beginning_and_the_end_are_kept() {
        let text_of = |bytes: Vec<u8>| Messages::of(Some(Cursor::new(bytes))).into_text();
        let short = "word\n".repeat(1000);
        assert_eq!(text_of(short.clone().into_bytes()), short);
        let whole = "w".repeat(2 * KEPT);
        assert_eq!(text_of(whole.clone().into_bytes()), whole);
        let long = text_of([b"begin".to_vec(), vec![b'x'; 5 * KEPT], b"end".to_vec()].concat());
        assert!(long.starts_with("begin") && long.ends_with("end"));
        assert!(long.contains(&format!("\n[... {} bytes left out ...]\n", 3 * KEPT + 8)), "{}", long.len());
        assert!(long.len() < 2 * KEPT + 100);
    }

    #[test]
    fn an_answer_ends_where_it_is_too_long() {
        let answer = |most| Answer::of(Some(Cursor::new(vec![7; 3 * PIECE])), most);
        assert_eq!(answer(3 * PIECE).given(), vec![7; 3 * PIECE]);
        let long = answer(3 * PIECE - 1);
        wait_for(&long.closed);
        assert!(long.is_too_long());
        assert_eq!(long.given().len(), 2 * PIECE);
    }

    #[test]
    fn lines_come_one_by_one_and_end_with_one_that_is_too_long() {
        let heard = |text: &'static str| lines(Some(text.as_bytes()), 8).into_iter().collect::<Vec<_>>();
        assert_eq!(heard("one\ntwo\r\n\nlast"), ["one", "two", "", "last"]);
        assert_eq!(heard("one\nmuch too long\nthree\n"), ["one"]);
    }
}
