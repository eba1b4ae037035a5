//! `stair figure`: results as pictures.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use lab::config::RunConfig;
use lab::figure::{self, FIGURES, Request, Source};
use lab::record::RunRecord;
use lab::temporal_map::TemporalMap;

use super::BadInput;

mod picture;
mod strips;

pub(super) use picture::{Format, encode};

/// Queries of each method in the figure `strips`.
const TOP: usize = 2;

/// Draw results: rows of evaluations, answers or probabilities, one JSON object a line
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
pub struct Args {
    /// Which figure
    name: String,
    /// Files of rows; for some figures also folders of runs or packed query sets
    #[arg(value_name = "ROWS")]
    rows: Vec<PathBuf>,
    /// What runs along the horizontal axis
    #[arg(long, value_name = "COLUMN")]
    x: Option<String>,
    /// What runs along the vertical axis
    #[arg(long, value_name = "COLUMN")]
    y: Option<String>,
    /// How several seeds become one line: mean, or iqm, the mean of the middle half
    #[arg(long, value_name = "HOW")]
    center: Option<String>,
    /// Queries of each method, for strips [default: 2]
    #[arg(long, value_name = "N")]
    top: Option<usize>,
    /// The episode to show, for temporal-map [default: the one that was asked about most]
    #[arg(long, value_name = "NUMBER")]
    episode: Option<u32>,
    /// Where to write it; .svg or .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Pixels of a PNG for each unit of the figure
    #[arg(long, default_value_t = 2.0, value_name = "TIMES")]
    scale: f32,
}

fn after_help() -> String {
    let mut text = "Figures and their rows:\n".to_owned();
    for figure in FIGURES {
        writeln!(text, "  {:20} {}", figure.name, figure.summary)
            .and_then(|()| writeln!(text, "  {:20} {}", "", figure.input))
            .expect("writing to a string cannot fail");
    }
    text.push_str(
        "\nExamples:
  stair figure curves results/*.jsonl --y success_rate --x step --out curves.svg
  stair figure curves data/train/go-fetch-return-stair-1 --out curves.png
  stair figure strips stair.queries pebble.queries --out strips.png
  stair figure temporal-map data/train/go-fetch-return-stair-1 --out map.svg",
    );
    text
}

/// Runs the command.
///
/// # Errors
/// [`BadInput`] for an unknown figure, rows that are none, or an ending that is no format; a
/// file that cannot be written.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let figure = figure::find(&args.name).map_err(BadInput::from_error)?;
    let format = Format::of(&args.out)?;
    if !(0.1..=10.0).contains(&args.scale) {
        let told = format!("--scale is {}, but must be from 0.1 to 10", args.scale);
        return Err(BadInput(told).into());
    }
    let sources = sources(figure.name, args)?;
    let request = Request {
        sources: &sources,
        x: args.x.as_deref(),
        y: args.y.as_deref(),
        center: args.center.as_deref(),
        ..Request::default()
    };
    let svg = figure::make(figure, &request).map_err(BadInput::from_error)?;
    write(&args.out, &encode(svg, format, args.scale)?)?;
    Ok(ExitCode::SUCCESS)
}

/// What a figure draws, from the files and folders that were named.
fn sources(figure: &str, args: &Args) -> anyhow::Result<Vec<Source>> {
    let refused = |option: &str| {
        let told = format!("{figure} leaves no choice of --{option}");
        Err(BadInput(told).into())
    };
    match (figure, args.top, args.episode) {
        (_, Some(_), _) if figure != "strips" => refused("top"),
        (_, _, Some(_)) if figure != "temporal-map" => refused("episode"),
        ("strips", top, _) => strips::sources(&args.rows, top.unwrap_or(TOP)),
        ("temporal-map", _, episode) => {
            let map = |path: &PathBuf| temporal_map(path, episode);
            args.rows.iter().map(map).collect()
        }
        _ => args.rows.iter().map(|path| read(path)).collect(),
    }
}

/// The map of a run's folder as a row, or a file of such rows as it is.
fn temporal_map(path: &Path, episode: Option<u32>) -> anyhow::Result<Source> {
    if !path.is_dir() {
        return read(path);
    }
    let record = RunRecord::open(path).map_err(BadInput::from_error)?;
    let map = TemporalMap::of(&record, episode).map_err(BadInput::from_error)?;
    Ok(Source {
        name: path.display().to_string(),
        text: serde_json::to_string(&map)?,
    })
}

/// Writes a file, and makes its folder where there is none.
pub(super) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(path, bytes))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// A file of rows, or a run's folder (or its metrics) as the rows of its evaluations.
fn read(path: &Path) -> anyhow::Result<Source> {
    let text = |path: &Path| {
        std::fs::read_to_string(path)
            .map_err(|error| BadInput(format!("cannot read {}: {error}", path.display())))
    };
    if path.ends_with("metrics.jsonl") && path.with_file_name("config.toml").exists() {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        return read(folder.unwrap_or(Path::new(".")));
    }
    if !path.is_dir() {
        return Ok(Source {
            name: path.display().to_string(),
            text: text(path)?,
        });
    }
    let (settings, metrics) = (path.join("config.toml"), path.join("metrics.jsonl"));
    if !settings.exists() {
        return Err(BadInput(format!("{} is not the folder of a run", path.display())).into());
    }
    let config = RunConfig::parse(&settings.display().to_string(), &text(&settings)?)
        .map_err(BadInput::from_error)?;
    let name = metrics.display().to_string();
    let text = figure::rows_of_run(&config, &name, &text(&metrics)?);
    Ok(Source {
        text: text.map_err(BadInput::from_error)?,
        name,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(rows: PathBuf, out: PathBuf) -> Args {
        Args {
            name: "curves".into(),
            rows: vec![rows],
            x: None,
            y: None,
            center: None,
            top: None,
            episode: None,
            out,
            scale: 1.0,
        }
    }

    #[test]
    fn a_runs_folder_is_drawn_as_it_lies_and_twice_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let run_folder = folder.path().join("run");
        let evaluation = |step: u32| {
            format!(
                "{{\"kind\":\"evaluation\",\"step\":{step},\"labels\":10,\"episodes\":5,\"success_rate\":0.5,\
                 \"return_mean\":1.0,\"return_std\":0.0,\"reward_correlation\":null}}\n"
            )
        };
        write(
            &run_folder.join("config.toml"),
            RunConfig::default().to_toml().as_bytes(),
        )
        .unwrap();
        let metrics = evaluation(0) + &evaluation(1_000);
        write(&run_folder.join("metrics.jsonl"), metrics.as_bytes()).unwrap();
        for ending in ["svg", "png"] {
            let draw = |name: &str| {
                let out = folder.path().join(name).with_extension(ending);
                run(&args(run_folder.clone(), out.clone())).unwrap();
                std::fs::read(out).unwrap()
            };
            let first = draw("first");
            assert!(!first.is_empty() && first == draw("second"), "{ending}");
            let out = folder.path().join("third").with_extension(ending);
            run(&args(run_folder.join("metrics.jsonl"), out.clone())).unwrap();
            assert_eq!(std::fs::read(out).unwrap(), first, "by its metrics");
        }
    }

    #[test]
    fn an_option_of_another_figure_is_bad_input() {
        let mut args = args("rows.jsonl".into(), "figure.svg".into());
        args.top = Some(3);
        let told = run(&args).unwrap_err();
        assert!(told.is::<BadInput>() && told.to_string().contains("no choice of --top"));
        (args.top, args.episode) = (None, Some(3));
        let told = run(&args).unwrap_err().to_string();
        assert!(told.contains("no choice of --episode"), "{told}");
    }

    #[test]
    fn strips_and_maps_of_what_holds_none_are_bad_input() {
        let folder = tempfile::tempdir().unwrap();
        let foreign = folder.path().join("mine.queries");
        write(&foreign, b"no queries").unwrap();
        for (name, rows, said) in [
            ("strips", foreign, "is no packed query set"),
            ("strips", folder.path().to_owned(), "holds no run"),
            ("temporal-map", folder.path().to_owned(), "holds no run"),
        ] {
            let mut args = args(rows, folder.path().join("figure.svg"));
            args.name = name.into();
            let told = run(&args).unwrap_err();
            assert!(
                told.is::<BadInput>() && told.to_string().contains(said),
                "{told}"
            );
        }
    }

    #[test]
    fn a_folder_that_holds_no_run_is_bad_input() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("figure.svg");
        let told = run(&args(folder.path().to_owned(), out)).unwrap_err();
        assert!(told.is::<BadInput>() && told.to_string().contains("not the folder of a run"));
    }
}
