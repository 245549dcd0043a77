//! Does the work of elastocal's hot paths on request: `make bench` times it beside other programs,
//! and `make instructions` counts its instructions.

#![expect(clippy::expect_used, reason = "a bench that cannot go on fails")]

mod absolute;
mod arms;
mod fit;
mod paths;
mod problem;

use std::collections::BTreeMap;
use std::time::Instant;

use paths::{HotPath, hot_path};

const USAGE: &str = "usage:
  driver problem                          prints the paths' data and results as JSON
  driver serve                            answers lines `PATH TIMES` with seconds
  driver repeat PATH TIMES [--slow-down]  does the work so often (a fifth more)";

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["problem"] => println!("{}", problem::problem()),
        ["serve"] => serve(),
        ["repeat", path, times] => repeat(path, number(times)),
        ["repeat", path, times, "--slow-down"] => {
            let times = number(times);
            repeat(path, times + times.div_ceil(5));
        }
        _ => {
            eprintln!("{USAGE}");
            std::process::exit(2);
        }
    }
}

fn repeat(path: &str, times: u64) {
    hot_path(path)(times);
}

fn number(text: &str) -> u64 {
    text.parse().expect("a whole number")
}

/// Prepared paths are kept, so that both programs of a comparison are warm.
fn serve() {
    let mut prepared = BTreeMap::<String, HotPath>::new();
    for line in std::io::stdin().lines() {
        let line = line.expect("the request can be read");
        let (path, times) = line.split_once(' ').expect("PATH TIMES");
        let work = prepared
            .entry(path.to_owned())
            .or_insert_with(|| hot_path(path));
        println!("{}", seconds(work, number(times)));
    }
}

fn seconds(work: &mut HotPath, times: u64) -> f64 {
    let start = Instant::now();
    work(times);
    start.elapsed().as_secs_f64()
}
