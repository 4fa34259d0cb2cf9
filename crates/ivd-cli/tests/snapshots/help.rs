//! `--help` of the program and of every command, and the schema.

use std::collections::BTreeSet;
use std::path::Path;

use crate::snapshots::{Said, check, check_files, ivd, words};

/// Every command with its page; the program itself is the empty name.
pub(crate) fn pages() -> Vec<(String, String)> {
    let mut pages = Vec::new();
    collect("", &mut pages);
    pages
}

fn collect(command: &str, pages: &mut Vec<(String, String)>) {
    let Said { code, out, err } = ivd(Path::new("."), &words(&format!("{command} --help")));
    assert_eq!((code, err.as_str()), (0, ""), "{command} --help");
    // A command's name is what a line of its own begins with below `Commands:`.
    let listed = out.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    let inner: Vec<String> = listed
        .filter(|l| l.starts_with("  ") && !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next())
        .filter(|name| *name != "help")
        .map(|name| format!("{command} {name}").trim().to_owned())
        .collect();
    pages.push((command.to_owned(), out));
    for command in inner {
        collect(&command, pages);
    }
}

#[test]
fn every_help_page_is_as_kept() {
    let file = |command: &str| match command {
        "" => "ivd.txt".to_owned(),
        command => format!("ivd-{}.txt", command.replace(' ', "-")),
    };
    let pages = pages();
    for (command, page) in &pages {
        check(&format!("help/{}", file(command)), page);
    }
    check_files("help", &pages.iter().map(|(command, _)| file(command)).collect::<BTreeSet<_>>());
}

#[test]
fn the_schema_is_as_kept() {
    let said = ivd(Path::new("."), &words("schema"));
    assert_eq!(said.code, 0);
    check("schema.json", &said.out);
}
