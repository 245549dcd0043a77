use elastocal::plan::search::*;
use elastocal::plan::*;
use std::time::Instant;
fn main() {
    let name = std::env::args().nth(1).unwrap();
    let s = elastocal::scenario::Scenario::load(std::path::Path::new(&name)).unwrap();
    let mut f = Feasibility::new(&s);
    for p in &s.plans {
        let plan = read_plan(&p.path, s.joints()).unwrap();
        for v in f.violations(&plan) {
            println!("{} {v}", p.name);
        }
    }
    let mut problem = Problem::new(&s, Criterion::TestPose);
    for p in &s.plans {
        let plan = read_plan(&p.path, s.joints()).unwrap();
        println!(
            "{} {:?}",
            p.name,
            problem
                .cost()
                .value(&problem.information(&plan))
                .map(|v| v * 1e6)
        );
    }
    for seed in 1..=std::env::args().nth(2).map_or(3, |a| a.parse().unwrap()) {
        let t = Instant::now();
        let a = approximate_design(&problem, seed).unwrap();
        println!(
            "seed {seed} approx {:?} support {} weights {:?} cost {:.5} d/phi {:.6} agreeing {}",
            t.elapsed(),
            a.support.len(),
            a.weights
                .iter()
                .map(|w| (w * 1000.).round() / 1000.)
                .collect::<Vec<_>>(),
            a.certificate.cost.sqrt() * 1e6,
            a.certificate.largest_derivative / a.certificate.cost,
            a.certificate.agreeing
        );
        if false {
            for p in &a.support {
                println!(
                    "  {:?}",
                    p.q.iter()
                        .map(|x| (x.to_degrees() * 10.).round() / 10.)
                        .collect::<Vec<_>>()
                );
                println!(
                    "   clear {:?}",
                    f.violations_of(1, &p.experiment(1))
                        .iter()
                        .map(|v| v.to_string())
                        .collect::<Vec<_>>()
                );
            }
        }
        let stop = std::sync::atomic::AtomicBool::new(false);
        for m in [2u32, 3, 4, 6, 12] {
            let t = Instant::now();
            let e = exact_design(
                &problem,
                &a,
                m,
                m,
                seed,
                Watch {
                    stop: &stop,
                    progress: &|_, _, _| {},
                },
            )
            .unwrap();
            println!(
                "  m={m} {:?} rho {:.4} eff {:.4} agreeing {} violations {}",
                t.elapsed(),
                e.cost.sqrt() * 1e6,
                (a.certificate.lower_bound(m) / e.cost).sqrt(),
                e.agreeing,
                f.violations(&e.plan).len()
            );
        }
    }
    problem.effort.starts = 1;
}
