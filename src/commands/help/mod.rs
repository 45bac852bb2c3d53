//! `lightprobe help`: the commands' flags, and the READMEs as topics.

mod markdown;

use anyhow::{Result, bail};
use clap::CommandFactory;

use super::Console;
use crate::cli::topics::TOPICS;
use crate::cli::{Cli, HelpArgs};
use crate::system::terminal;

/// Columns of a text that goes to a file or a pipe.
const WIDTH_OF_FILES: usize = 100;

/// Share of a name's letters from which on another one may be meant.
const LEAST_LIKENESS: f64 = 0.5;

pub fn run(args: &HelpArgs, console: &Console) -> Result<()> {
    let mut cli = Cli::command();
    // Gives the subcommands the flags that all share.
    cli.build();
    let Some(name) = args.name.as_deref() else {
        return console.print(&cli.render_help().to_string());
    };
    if let Some(command) = cli.find_subcommand_mut(name) {
        return console.print(&command.render_long_help().to_string());
    }
    if let Some(topic) = TOPICS.iter().find(|topic| topic.name == name) {
        let width = terminal::width().unwrap_or(WIDTH_OF_FILES);
        return console.print(&markdown::text(topic.text, width));
    }
    let commands = cli.get_subcommands().map(clap::Command::get_name);
    let near = |known: &&str| strsim::normalized_damerau_levenshtein(known, name) >= LEAST_LIKENESS;
    let nearest = commands
        .chain(TOPICS.iter().map(|topic| topic.name))
        .filter(near)
        .min_by_key(|known| strsim::damerau_levenshtein(known, name));
    let meant = nearest.map_or_else(String::new, |nearest| format!(": did you mean '{nearest}'?"));
    bail!("there is no command and no topic '{name}'{}; `lightprobe help` lists them", meant.trim_end_matches('?'))
}
