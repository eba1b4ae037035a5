//! `stair figure`: results as pictures.

use std::fmt::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use lab::config::RunConfig;
use lab::experiment::results::read_rows;
use lab::figure::{self, FIGURES, Request, Source};
use lab::record::RunRecord;
use lab::temporal_map::TemporalMap;

use super::{BadInput, number, out};

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
    /// Files of rows; for some figures also folders of runs or experiments, or packed query sets
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
    #[arg(long, value_name = "N", value_parser = number::at_least_one)]
    #[arg(allow_negative_numbers = true)]
    top: Option<NonZeroUsize>,
    /// The episode to show, for temporal-map [default: the one that was asked about most]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true)]
    episode: Option<u32>,
    /// Where to write it; .svg or .png
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Pixels of a PNG for each unit of the figure
    #[arg(
        long,
        default_value_t = 2.0,
        value_name = "TIMES",
        allow_negative_numbers = true
    )]
    scale: f32,
}

fn after_help() -> String {
    let mut text = "Figures and their rows:\n".to_owned();
    for figure in FIGURES {
        // Under the name and further in: a line that is too long goes on as far in as it began.
        let (name, summary, input) = (figure.name, figure.summary, figure.input);
        writeln!(text, "  {name}\n      {summary}\n      {input}")
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
    out::file(&args.out)?;
    let sources = sources(figure.name, args)?;
    let request = Request {
        sources: &sources,
        x: args.x.as_deref(),
        y: args.y.as_deref(),
        center: args.center.as_deref(),
        ..Request::default()
    };
    let svg = figure::make(figure, &request).map_err(BadInput::from_error)?;
    out::write(&args.out, &encode(svg, format, args.scale)?)?;
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
        ("strips", top, _) => strips::sources(&args.rows, top.map_or(TOP, NonZeroUsize::get)),
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

/// A file of rows, the rows in an experiment's folder, or a run's folder (or its metrics) as the
/// rows of its evaluations.
fn read(path: &Path) -> anyhow::Result<Source> {
    if path.ends_with("metrics.jsonl") && path.with_file_name("config.toml").exists() {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        return of_run(folder.unwrap_or(Path::new(".")));
    }
    if path.join("config.toml").exists() {
        return of_run(path);
    }
    let results = path.join("results.jsonl");
    if results.exists() {
        let rows = read_rows(&results);
        return Ok(Source {
            text: rows.map_err(|error| unreadable(&results, &error))?,
            name: results.display().to_string(),
        });
    }
    if path.is_dir() {
        let told = "is not the folder of a run or an experiment: it holds neither config.toml nor \
                    results.jsonl";
        return Err(BadInput(format!("{} {told}", path.display())).into());
    }
    Ok(Source {
        text: text(path)?,
        name: path.display().to_string(),
    })
}

/// The evaluations of a run as rows.
fn of_run(folder: &Path) -> anyhow::Result<Source> {
    let (settings, metrics) = (folder.join("config.toml"), folder.join("metrics.jsonl"));
    let config = RunConfig::parse(&settings.display().to_string(), &text(&settings)?)
        .map_err(BadInput::from_error)?;
    let name = metrics.display().to_string();
    let rows = figure::rows_of_run(&config, &name, &text(&metrics)?);
    Ok(Source {
        text: rows.map_err(BadInput::from_error)?,
        name,
    })
}

fn text(path: &Path) -> Result<String, BadInput> {
    std::fs::read_to_string(path).map_err(|error| unreadable(path, &error))
}

fn unreadable(path: &Path, error: &std::io::Error) -> BadInput {
    BadInput(format!("cannot read {}: {error}", path.display()))
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
        out::write(
            &run_folder.join("config.toml"),
            RunConfig::default().to_toml().as_bytes(),
        )
        .unwrap();
        let metrics = evaluation(0) + &evaluation(1_000);
        out::write(&run_folder.join("metrics.jsonl"), metrics.as_bytes()).unwrap();
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
        args.top = NonZeroUsize::new(3);
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
        out::write(&foreign, b"no queries").unwrap();
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
    fn an_experiments_folder_is_drawn_as_its_rows() {
        let folder = tempfile::tempdir().unwrap();
        let rows = folder.path().join("results.jsonl");
        let row = |step: u32| {
            format!(
                "{{\"task\":\"go-fetch-return\",\"method\":\"stair\",\"teacher\":\"oracle\",\"setting\":\"\",\
                 \"seed\":1,\"kind\":\"evaluation\",\"step\":{step},\"labels\":4,\"episodes\":10,\
                 \"success_rate\":0.5,\"return_mean\":7.5,\"return_std\":1.0,\"reward_correlation\":null}}\n"
            )
        };
        out::write(&rows, (row(0) + &row(1_000)).as_bytes()).unwrap();
        let [of_rows, of_folder] = [rows.as_path(), folder.path()].map(|path: &Path| {
            let out = folder.path().join("figure.svg");
            run(&args(path.to_owned(), out.clone())).unwrap();
            std::fs::read(out).unwrap()
        });
        assert_eq!(of_rows, of_folder);
    }

    #[test]
    fn a_figure_that_has_no_place_is_refused_before_it_is_drawn() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("rows.jsonl");
        out::write(&file, b"no rows").unwrap();
        let told = run(&args(file.clone(), file.join("figure.svg"))).unwrap_err();
        assert!(told.is::<BadInput>() && told.to_string().contains("is no folder"));
    }

    #[test]
    fn a_folder_that_holds_no_run_is_bad_input() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("figure.svg");
        let told = run(&args(folder.path().to_owned(), out)).unwrap_err();
        assert!(told.is::<BadInput>() && told.to_string().contains("not the folder of a run"));
    }
}
