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
    let nearest = commands
        .chain(TOPICS.iter().map(|topic| topic.name))
        .min_by_key(|known| strsim::damerau_levenshtein(known, name))
        .unwrap_or("help");
    bail!("there is no command and no topic '{name}': did you mean '{nearest}'? `lightprobe help` lists them")
}
