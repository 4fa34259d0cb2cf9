//! Thousands of bad files at the door of the program, each with the exit code that it must meet.
//!
//! A case is made from a good file by a rule, and the rule says what must come of it: the code isn't read off the
//! program. The operating system holds every run to 64 MiB and four times its files, so that a lying header can't get
//! memory for its lie; no run may panic, take long, leave an output behind a failure, or fail without naming the file.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test fails where it can't go on")]
#![allow(
    clippy::needless_pass_by_value,
    clippy::format_push_string,
    clippy::format_collect,
    reason = "a case is made once: what is short to read is fast enough"
)]

mod artefacts;
mod bombs;
pub(crate) mod case;
mod dicom;
mod good;
mod nifti;
mod pictures;
mod shown;
mod special;
mod text_headers;
mod typed;
mod vti;

use case::{Case, run_all, run_share};

#[test]
fn nifti_headers_that_lie_in_any_field() {
    assert!(run_share(nifti::cases()) >= 500);
}

#[test]
fn nrrd_headers_that_lie_in_any_field() {
    assert!(run_share(text_headers::nrrd()) >= 250);
}

#[test]
fn metaimage_headers_that_lie_in_any_field() {
    assert!(run_share(text_headers::metaimage()) >= 250);
}

#[test]
fn vti_files_with_any_attribute_wrong() {
    assert!(run_share(vti::cases()) >= 120);
}

#[test]
fn pictures_with_any_tag_wrong() {
    assert!(run_share(pictures::cases()) >= 150);
}

#[test]
fn dicom_files_with_any_element_wrong() {
    assert!(run_share(dicom::cases()) >= 150);
}

#[test]
fn artefacts_of_every_kind_damaged_anywhere() {
    assert!(run_share(artefacts::cases()) >= 600);
}

#[test]
fn scenes_and_parameters_that_can_not_be_meant() {
    assert!(run_all(typed::cases()) >= 200);
}

#[test]
fn cuts_and_flips_of_every_volume_format() {
    assert!(run_share(good::damaged()) >= 500);
}

#[test]
fn bombs_take_no_memory() {
    assert!(run_all(bombs::cases()) >= 12);
}

#[test]
fn devices_folders_pipes_and_loops_are_no_volumes() {
    special::check();
}

#[test]
fn text_of_volume_files_is_shown_and_kept_in_json() {
    shown::check("volumes");
}

#[test]
fn text_of_xml_is_shown_and_kept_in_json() {
    shown::check("xml");
}

#[test]
fn text_of_meshes_is_shown_and_kept_in_json() {
    shown::check("meshes");
}

#[test]
fn text_of_artefacts_is_shown_and_kept_in_json() {
    shown::check("artefacts");
}

#[test]
fn text_of_scenes_is_shown_and_kept_in_json() {
    shown::check("scenes");
}

#[test]
fn words_and_paths_are_shown_and_kept_in_json() {
    shown::check("words");
}

#[test]
fn text_on_pages_is_shown() {
    shown::check_page();
}

/// The bound must bite, or no case proves anything: what takes more is stopped by the system.
#[test]
fn the_bound_on_memory_bites() {
    let bomb = |mebibytes: usize, codes| {
        let packed = good::gzip(&vec![0; mebibytes << 20]);
        let header =
            format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1024 1024 {mebibytes}\nencoding: gzip\n\n");
        Case::new(format!("{mebibytes} MiB declared and there"), codes)
            .file("a.nrrd", [header.as_bytes(), &packed].concat())
            .words("import a.nrrd -o out.ivd")
    };
    run_all(vec![bomb(16, &[0]), bomb(200, &[4]).says("memory")]);
    let unbound = |limit: &str, codes| {
        bomb(200, codes).words(&format!("import a.nrrd -o out.ivd --memory-limit {limit}"))
    };
    run_all(vec![unbound("64MiB", &[4]).says("memory"), unbound("1GiB", &[0]).unbound()]);
}
