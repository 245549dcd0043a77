//! A real browser looks at the pages.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::support::{Workplace, list, project};

/// A page of text alone has no figures.
const FEWEST_SHAPES: u64 = 8;

/// The user's own Chromium, or the system's.
fn chromium() -> Option<PathBuf> {
    if let Some(own) = std::env::var_os("ELASTOCAL_CHROMIUM") {
        return Some(own.into());
    }
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find_map(|name| {
            let mut places = folders.iter().map(|folder| folder.join(name));
            places.find(|place| place.is_file())
        })
}

/// What the browser sees of a page, looked at in this way; `None` without a browser, which is
/// said even where tests' outputs are captured.
fn look(page: &Path, way: &str) -> Option<Value> {
    let Some(chromium) = chromium() else {
        let text = "\nSKIPPED: there is no Chromium to look at pages (tools/install-chromium)\n";
        std::io::stderr()
            .write_all(text.as_bytes())
            .expect("stderr");
        return None;
    };
    let output = Command::new("python3")
        .arg(project("tests/browser/look_at_page.py"))
        .arg(chromium)
        .arg(page)
        .args(way.split(' '))
        .output()
        .expect("python3 starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {said}", page.display());
    Some(serde_json::from_slice(&output.stdout).expect("JSON"))
}

fn is_empty(value: &Value) -> bool {
    value.as_array().expect("an array").is_empty()
}

/// Asserts that a person would see the page with its figures, on a screen, on a phone and on paper: no error,
/// nothing loaded, nothing empty, no text small, faint, cut off or on other text.
pub fn looks_well(page: &Path, figures: usize) {
    looks_well_in(page, figures, [1600, 700, 390]);
}

fn looks_well_in(page: &Path, figures: usize, readable_px: impl IntoIterator<Item = i32>) {
    let readable_px: Vec<i32> = readable_px.into_iter().collect();
    for (width_px, scheme) in [
        (1600, ""),
        (1600, " --dark"),
        (700, ""),
        (700, " --dark"),
        (390, ""),
    ] {
        let Some(seen) = look(page, &format!("--width {width_px}{scheme}")) else {
            return;
        };
        let place = format!("{} at {width_px} px{scheme}", page.display());
        assert!(is_empty(&seen["cut"]), "{place}: {}", seen["cut"]);
        assert!(
            !readable_px.contains(&width_px) || is_empty(&seen["small"]),
            "{place}: {}",
            seen["small"]
        );
        assert!(is_empty(&seen["faint"]), "{place}: {}", seen["faint"]);
        assert!(is_empty(&seen["errors"]), "{place}: {}", seen["errors"]);
        assert!(is_empty(&seen["console"]), "{place}: {}", seen["console"]);
        // The view that turns has the only scripts: its data, and what draws it.
        let views = list(&seen["views"]);
        assert_eq!(seen["scripts"].as_u64(), Some(2 * views.len() as u64));
        for view in views {
            // A slim arm that is folded up covers little more than half a percent.
            assert!(view["drawn"].as_f64() > Some(0.004), "{place}: {view}");
            assert_eq!(view["cut"], 0, "{place}: {view}");
            let stills = found_stills(&seen);
            assert_eq!(view["steps"], stills > 1, "{place}: {view}");
            assert!(
                view["words"].as_str().expect("text").contains("q = "),
                "{place}"
            );
        }
        assert_eq!(
            seen["requests"].as_array().map(Vec::len),
            Some(1),
            "{place}"
        );
        assert_eq!(
            seen["page_px"][0], width_px,
            "{place} is wider than the window"
        );
        let found = list(&seen["figures"]);
        assert_eq!(found.len(), figures, "{place}");
        for figure in found {
            let label = &figure["label"];
            assert!(
                label.as_str().is_some_and(|label| !label.is_empty()),
                "{place}"
            );
            // A still is a picture of pixels with a few shapes over it.
            let pictures = list(&figure["pictures_px"]);
            let is_still = pictures.iter().any(|width| width.as_f64() > Some(100.0));
            assert!(
                is_still || figure["shapes"].as_u64() >= Some(FEWEST_SHAPES),
                "{place}: {label}"
            );
            for side in list(&figure["content_px"]) {
                assert!(side.as_f64() > Some(100.0), "{place}: {label} is empty");
            }
            assert!(is_empty(&figure["outside"]), "{place}: {figure:#}");
            assert!(is_empty(&figure["overlaps"]), "{place}: {figure:#}");
        }
    }
    for (paper, size_mm) in [("a4", [210.0, 297.0]), ("letter", [215.9, 279.4])] {
        prints_well(page, paper, size_mm);
    }
}

fn found_stills(seen: &Value) -> usize {
    let figures = list(&seen["figures"]).iter();
    let labels = figures.filter_map(|figure| figure["label"].as_str());
    labels
        .filter(|label| label.starts_with("Experiment "))
        .count()
}

/// Asserts that a person would see a plot that is a file of its own.
pub fn plot_looks_well(svg: &Path) {
    let page = svg.with_extension("html");
    let drawing = std::fs::read_to_string(svg).expect("it is there");
    let html = format!(
        "<!DOCTYPE html><html lang='en'><head><title>plot</title><meta name='viewport' content='width=device-width'><link rel='icon' href='data:,'><style>svg {{ width: 100%; height: auto }} \
         body {{ margin: 0; background: #fff }} @media screen and (prefers-color-scheme: dark) {{ body {{ background: #171c22 }} }}</style></head><body><div aria-label='plot'>{drawing}</div></body></html>"
    );
    std::fs::write(&page, html).expect("it can be written");
    // A plot is made for a sheet or a screen, not for a phone.
    looks_well_in(&page, 1, [1600]);
}

/// Asserts that a page comes out on sheets of a size, and that none of it is cut off there.
fn prints_well(page: &Path, paper: &str, size_mm: [f64; 2]) {
    let Some(seen) = look(page, &format!("--paper {paper} --dark")) else {
        return;
    };
    let place = format!("{} on {paper}", page.display());
    assert!(is_empty(&seen["cut"]), "{place}: {}", seen["cut"]);
    assert!(is_empty(&seen["faint"]), "{place}: {}", seen["faint"]);
    assert_eq!(seen["page_px"][0], seen["window_px"], "{place}");
    let sheets = list(&seen["pages_mm"]);
    assert!((1..20).contains(&sheets.len()), "{place}: {sheets:?}");
    for sheet in sheets {
        for (side, found) in size_mm.iter().zip(sheet.as_array().expect("two sides")) {
            let found = found.as_f64().expect("a number");
            assert!((found - side).abs() < 0.5, "{place}: {sheet}");
        }
    }
}

/// The look itself sees what is wrong with a page.
#[test]
fn the_look_sees_what_is_wrong() {
    let workplace = Workplace::with(
        "wrong.html",
        "<!DOCTYPE html><html><body><div style='width: 3000px'>wide</div>\
         <svg width='200' height='100' aria-label='two'><text x='10' y='50'>One text</text>\
         <text x='12' y='52'>on another</text><text x='180' y='90'>cut off</text></svg>\
         <p style='color: #999; background: #fff'>too faint</p><p style='font-size: 9px'>tiny</p>\
         <div style='width: 40px; overflow: auto'><p style='width: 60px'>scrolls</p></div>\
         <img src='missing.png'><script>console.log('hello'); nothing.works();</script></body></html>",
    );
    let Some(seen) = look(&workplace.path("wrong.html"), "--width 1280") else {
        return;
    };
    assert_eq!(seen["faint"], serde_json::json!(["too faint"]));
    assert_eq!(seen["cut"], serde_json::json!(["scrolls"]));
    assert_eq!(seen["small"], serde_json::json!(["9.0 px: tiny"]));
    assert_eq!(seen["scripts"], 1);
    assert_eq!(seen["console"], serde_json::json!(["hello"]));
    assert!(!is_empty(&seen["errors"]));
    assert!(seen["page_px"][0].as_f64() >= Some(3000.0));
    let requests = list(&seen["requests"]);
    assert_eq!(requests.len(), 2, "{requests:?}");
    let figure = &seen["figures"][0];
    assert_eq!(figure["shapes"], 0);
    assert_eq!(figure["outside"], serde_json::json!(["cut off"]));
    assert_eq!(
        figure["overlaps"],
        serde_json::json!([["One text", "on another"]])
    );
}
