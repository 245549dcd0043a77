//! After which runs it is looked at how far a study has come.

/// Snapshots are taken after so many runs within the first block.
pub const FIRST_RUNS: [u64; 7] = [10, 20, 50, 100, 200, 500, 1000];

/// After how many blocks the snapshot that follows the one after `done` is taken: 8 to 16 snapshots
/// while the number doubles, so that any number of runs comes with a few hundred at most, and the
/// threads seldom wait for one another.
pub const fn next_snapshot(done: u64) -> u64 {
    let eighth = done / 8;
    let step = if eighth == 0 { 1 } else { 1 << eighth.ilog2() };
    (done / step + 1) * step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapshots_are_few_and_get_rarer() {
        let mut count = 0;
        let mut done = 0;
        while done < 500_000_000 {
            let next = next_snapshot(done);
            assert!(next > done && next - done <= (done / 8).max(1), "{done}");
            done = next;
            count += 1;
        }
        assert!((200..300).contains(&count), "{count}");
    }
}
