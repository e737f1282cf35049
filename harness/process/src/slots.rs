//! Slots: how much of the machine runs at a time, so that engines side by side do not starve each other.
//!
//! An engine that is given k threads or processes holds k slots as long as it works, so that one that keeps its budget by the clock has the
//! processors that it counts on; one that sleeps holds none, and one that sleeps as long as it works half of them. Memory is handed out likewise, by estimate. Whoever comes first is served
//! first: a job that needs every slot is not passed by small ones for ever.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use parking_lot::{Condvar, Mutex};

/// The part of the free memory that jobs may have together.
const SHARE_OF_MEMORY: f64 = 0.8;

/// More threads than this a reading are no use: Radiance's and POV-Ray's fewest blocks are eight.
const MAX_A_READING: usize = 8;

#[derive(Debug)]
pub struct Slots {
    all: Share,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    pub threads: usize,
    /// Memory in MiB, an estimate.
    pub memory_mib: u64,
}

#[derive(Debug)]
struct State {
    free: Part,
    next_ticket: u64,
    served: u64,
}

/// What is free or taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    half_threads: usize,
    memory_mib: u64,
}

/// Slots in use; they are free again when this is dropped.
#[derive(Debug)]
pub struct SlotGuard<'a> {
    slots: &'a Slots,
    threads: usize,
    part: Part,
}

impl Slots {
    /// So many threads or processes at a time, and most of the memory that is free now.
    pub fn new(threads: usize) -> Self {
        Self::with_memory(threads, free_memory_mib().unwrap_or(u64::MAX))
    }

    fn with_memory(threads: usize, memory_mib: u64) -> Self {
        let all = Share { threads: threads.max(1), memory_mib };
        let free = Part { half_threads: 2 * all.threads, memory_mib };
        let state = State { free, next_ticket: 0, served: 0 };
        Self { all, state: Mutex::new(state), changed: Condvar::new() }
    }

    pub fn threads(&self) -> usize {
        self.all.threads
    }

    /// Threads for a reading of sampled, reflected light, which makes the most of its seconds with many.
    pub fn threads_a_reading(&self) -> usize {
        self.all.threads.min(MAX_A_READING)
    }

    /// Waits for a share. What asks for more than there is gets all that there is; what asks for no thread waits for no turn.
    pub fn take(&self, share: Share) -> SlotGuard<'_> {
        self.take_halves(share, 2)
    }

    /// The same for what sleeps half of its time, and leaves half of its threads to others.
    pub fn take_half(&self, share: Share) -> SlotGuard<'_> {
        self.take_halves(share, 1)
    }

    fn take_halves(&self, share: Share, of_each: usize) -> SlotGuard<'_> {
        let threads = share.threads.min(self.all.threads);
        let part = Part { half_threads: of_each * threads, memory_mib: share.memory_mib.min(self.all.memory_mib) };
        let held = SlotGuard { slots: self, threads, part };
        let mut state = self.state.lock();
        if threads == 0 {
            while state.free.memory_mib < part.memory_mib {
                self.changed.wait(&mut state);
            }
            state.free.memory_mib -= part.memory_mib;
            return held;
        }
        let ticket = state.next_ticket;
        state.next_ticket += 1;
        while state.served != ticket
            || state.free.half_threads < part.half_threads
            || state.free.memory_mib < part.memory_mib
        {
            self.changed.wait(&mut state);
        }
        state.served += 1;
        state.free.half_threads -= part.half_threads;
        state.free.memory_mib -= part.memory_mib;
        self.changed.notify_all();
        held
    }
}

impl SlotGuard<'_> {
    /// One at least, if only to wait on.
    pub fn threads(&self) -> usize {
        self.threads.max(1)
    }
}

impl Drop for SlotGuard<'_> {
    fn drop(&mut self) {
        let mut state = self.slots.state.lock();
        state.free.half_threads += self.part.half_threads;
        state.free.memory_mib += self.part.memory_mib;
        self.slots.changed.notify_all();
    }
}

/// Does something with every item on so many threads, begun in the items' order; the results are in that order too, whoever ends first.
pub fn side_by_side<T: Sync, R: Send>(threads: usize, items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let mut results: Vec<(usize, R)> = thread::scope(|scope| {
        let threads = threads.clamp(1, items.len().max(1));
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(|| work_through(&next, items, &work))).collect();
        workers.into_iter().flat_map(join).collect()
    });
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, result)| result).collect()
}

/// Works on the next item until none is left; results with the items' places.
fn work_through<T, R>(next: &AtomicUsize, items: &[T], work: &impl Fn(&T) -> R) -> Vec<(usize, R)> {
    let mut done = vec![];
    loop {
        let k = next.fetch_add(1, Ordering::Relaxed);
        let Some(item) = items.get(k) else { return done };
        done.push((k, work(item)));
    }
}

/// The result of a thread; its panic goes on in this one.
fn join<R>(worker: thread::ScopedJoinHandle<'_, R>) -> R {
    worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// `MemAvailable` of /proc/meminfo, less what is left to others.
fn free_memory_mib() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some((SHARE_OF_MEMORY * kib / 1024.0) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_than_all_slots_and_all_memory_are_ever_in_use() {
        let slots = Slots::with_memory(3, 1000);
        let (threads, memory) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let items: Vec<(usize, u64)> = (0..200).map(|k| (1 + k % 5, [10, 400, 5000, 900][k % 4])).collect();
        let done = side_by_side(8, &items, |&(want, mib)| {
            let held = slots.take(Share { threads: want, memory_mib: mib });
            assert_eq!(held.threads(), want.min(3));
            let used = threads.fetch_add(held.threads(), Ordering::SeqCst) + held.threads();
            let mib = mib.min(1000) as usize;
            let reserved = memory.fetch_add(mib, Ordering::SeqCst) + mib;
            assert!(used <= 3 && reserved <= 1000, "{used} slots, {reserved} MiB");
            thread::yield_now();
            threads.fetch_sub(held.threads(), Ordering::SeqCst);
            memory.fetch_sub(mib, Ordering::SeqCst);
            want
        });
        assert_eq!(done, items.iter().map(|i| i.0).collect::<Vec<_>>(), "results stay in the items' order");
    }

    #[test]
    fn a_job_that_needs_every_slot_is_not_passed_by_those_that_came_later() {
        let slots = Slots::with_memory(2, 100);
        let order = Mutex::new(vec![]);
        let first = slots.take(Share { threads: 1, memory_mib: 1 });
        thread::scope(|scope| {
            for (k, threads) in [(0, 2), (1, 1)] {
                let waiting = slots.state.lock().next_ticket;
                let (slots, order) = (&slots, &order);
                scope.spawn(move || {
                    let _held = slots.take(Share { threads, memory_mib: 1 });
                    order.lock().push(k);
                });
                while slots.state.lock().next_ticket == waiting {
                    thread::yield_now();
                }
            }
            drop(first);
        });
        assert_eq!(order.into_inner(), [0, 1]);
    }

    #[test]
    fn what_sleeps_waits_for_nobody_and_holds_nobody_up() {
        let slots = Slots::with_memory(1, 100);
        let one = Share { threads: 1, memory_mib: 1 };
        let working = slots.take(one);
        let sleeping = slots.take(Share { threads: 0, memory_mib: 90 });
        assert_eq!((sleeping.threads(), slots.state.lock().free), (1, Part { half_threads: 0, memory_mib: 9 }));
        drop(working);
        drop(slots.take(one));
        drop(sleeping);
        assert_eq!(slots.state.lock().free, Part { half_threads: 2, memory_mib: 100 });
    }

    #[test]
    fn two_that_sleep_half_of_their_time_take_the_place_of_one() {
        let slots = Slots::with_memory(2, 100);
        let share = Share { threads: 1, memory_mib: 10 };
        let held = [slots.take_half(share), slots.take_half(share), slots.take(share)];
        assert_eq!(slots.state.lock().free, Part { half_threads: 0, memory_mib: 70 });
        assert!(held.iter().all(|held| held.threads() == 1));
        drop(held);
        assert_eq!(slots.take_half(Share { threads: 9, memory_mib: 1 }).threads(), 2);
    }

    #[test]
    fn the_memory_of_this_machine_is_known() {
        assert!(free_memory_mib().is_some_and(|mib| mib > 10));
    }
}
