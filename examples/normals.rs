use elastocal::study::normal::*;
use std::time::Instant;
fn main(){ let mut n=vec![[0.0;LANES];36]; let mut s=0.0; let t=Instant::now(); let runs=8_000_000u64; for b in 0..runs/8 { fill_normals(1,b*8,&mut n); s+=n[35][7]; } let e=t.elapsed().as_secs_f64(); println!("{s} {:.3} ns per normal, {:.1} ns per run", e/runs as f64/36.*1e9, e/runs as f64*1e9); }
