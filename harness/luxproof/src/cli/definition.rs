//! The command line as clap sees it: commands in groups, and each global option only where it matters.

use clap::{Arg, Command, CommandFactory};

use super::Cli;

/// Options that clap accepts everywhere.
const GLOBAL_OPTIONS: [&str; 3] = ["engines_dir", "cache_dir", "untrusted"];

/// A group of commands in `luxproof --help`.
struct CommandGroup {
    heading: &'static str,
    commands: &'static [CommandEntry],
}

/// A command and the global options that matter to it.
type CommandEntry = (&'static str, &'static [&'static str]);

const ENGINES: &[&str] = &["engines_dir"];
const UNTRUSTED: &[&str] = &["untrusted"];
const ENGINES_AND_UNTRUSTED: &[&str] = &["engines_dir", "untrusted"];
const ALL: &[&str] = &GLOBAL_OPTIONS;

/// All commands that `--help` lists.
const GROUPS: [CommandGroup; 4] = [
    CommandGroup {
        heading: "Daily",
        commands: &[
            ("init", &[]),
            ("import", UNTRUSTED),
            ("check", ENGINES_AND_UNTRUSTED),
            ("run", ALL),
            ("open", &[]),
            ("report", ENGINES_AND_UNTRUSTED),
            ("engines", ENGINES_AND_UNTRUSTED),
            ("photometry", UNTRUSTED),
        ],
    },
    CommandGroup {
        heading: "Continuous integration",
        commands: &[("accept", &[]), ("diff", &[]), ("history", &[]), ("bisect", ALL), ("plan", ALL), ("read", ALL)],
    },
    CommandGroup {
        heading: "Research",
        commands: &[
            ("bundle", UNTRUSTED),
            ("reproduce", ALL),
            ("cards", ENGINES_AND_UNTRUSTED),
            ("hunt", ENGINES),
            ("shrink", ENGINES),
            ("stress", ENGINES_AND_UNTRUSTED),
            ("bench", ENGINES_AND_UNTRUSTED),
            ("selftest", &["engines_dir", "cache_dir"]),
            ("conformance", &[]),
        ],
    },
    CommandGroup {
        heading: "Maintenance",
        commands: &[
            ("cache", &["cache_dir"]),
            ("export", ENGINES_AND_UNTRUSTED),
            ("schema", &[]),
            ("completions", &[]),
            ("man", &[]),
        ],
    },
];

/// The program's command line.
pub(super) fn definition() -> Command {
    let mut program = Cli::command();
    let groups = list_commands(&program);
    for (name, shown) in GROUPS.iter().flat_map(|group| group.commands) {
        // A subcommand keeps its own option where it has one, so the global one does not reach it.
        let hidden = program.get_arguments().filter(|arg| is_hidden(arg, shown)).map(|arg| arg.clone().hide(true));
        let hidden: Vec<Arg> = hidden.collect();
        program = program.mut_subcommand(name, |command| command.args(hidden));
    }
    program.help_template(format!(
        "{{about}}\n\n{{usage-heading}} {{usage}}\n\n{groups}Options:\n{{options}}\n\n\
         `luxproof COMMAND --help` explains a command. Exit codes: 0 passed, 1 failed, 2 wrong input,\n\
         3 an engine failed or is missing, 4 undecided."
    ))
}

/// The commands in their groups, one line each.
fn list_commands(program: &Command) -> String {
    let mut text = String::new();
    for CommandGroup { heading, commands } in &GROUPS {
        text += &format!("{heading}:\n");
        for (name, _) in *commands {
            let about = program.find_subcommand(name).and_then(Command::get_about);
            let about = about.map(ToString::to_string).unwrap_or_default();
            text += &format!("  {name:<11}  {about}\n");
        }
        text += "\n";
    }
    text
}

/// Whether a global option does not matter to a command that shows others.
fn is_hidden(option: &Arg, shown: &[&str]) -> bool {
    let id = option.get_id().as_str();
    GLOBAL_OPTIONS.contains(&id) && !shown.contains(&id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use itertools::Itertools as _;

    #[test]
    fn every_command_is_in_one_group_of_the_help() {
        let program = Cli::command();
        let defined =
            program.get_subcommands().filter(|command| !command.is_hide_set()).map(Command::get_name).sorted();
        let grouped = GROUPS.iter().flat_map(|group| group.commands).map(|(name, _)| *name).sorted();
        assert_eq!(defined.collect_vec(), grouped.collect_vec());
    }

    #[test]
    fn short_help_fits_a_screen_and_shows_global_options_only_where_they_matter() {
        let mut program = definition().term_width(80);
        program.build();
        let names = GROUPS.iter().flat_map(|group| group.commands).map(|(name, _)| *name);
        assert!(program.render_help().to_string().lines().count() <= 48, "the list of 27 commands in four groups");
        for name in names {
            let command = program.find_subcommand_mut(name).unwrap();
            let short = command.render_help().to_string();
            assert!(short.lines().count() <= 24, "{name}: {} lines\n{short}", short.lines().count());
            assert!(!short.contains("\n      --untrusted"), "{name}");
            let long = command.render_long_help().to_string();
            assert_eq!(
                long.contains("\n      --untrusted"),
                !matches!(
                    name,
                    "init"
                        | "open"
                        | "accept"
                        | "diff"
                        | "history"
                        | "hunt"
                        | "shrink"
                        | "selftest"
                        | "cache"
                        | "schema"
                        | "conformance"
                        | "completions"
                        | "man"
                ),
                "{name}"
            );
        }
    }

    #[test]
    fn hidden_global_options_are_still_accepted() {
        use clap::FromArgMatches as _;
        let folders = ["--engines-dir", "engines", "--cache-dir", "cache"];
        for words in [["luxproof", "--untrusted", "schema"], ["luxproof", "schema", "--untrusted"]] {
            let matches = definition().try_get_matches_from(words.into_iter().chain(folders)).unwrap();
            assert!(Cli::from_arg_matches(&matches).unwrap().untrusted, "{words:?}");
        }
    }
}
