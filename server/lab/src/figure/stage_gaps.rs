//! How far the segments of a pair are apart in the task, of chosen pairs and of all candidates:
//! where the chosen ones lie below, the queries climb through the task stage by stage.

use std::collections::BTreeMap;

use domain::agreement::interquartile_mean;
use learn::stage::StageApproximator;

use super::seeds::{
    Between, Bundle, Curve, SeedSheet, Shown, add_line, apart, drawn_lines, in_order_of_appearance,
    is_by_setting, line_name, quoted, seeds_in_words,
};
use super::{FigureEntry, FigureError, Request, find, read_rows};
use crate::config::RunConfig;
use crate::experiment::grid::RunKey;
use crate::experiment::results::{Content, Row};
use crate::method;

const INPUT: &str =
    "the results or the folder of an experiment, from methods that have a stage gap";

pub(super) const ENTRY: FigureEntry = FigureEntry {
    name: "stage-gaps",
    summary: "stage gap of chosen pairs against all candidates, over environment steps",
    input: INPUT,
    choices: &[],
    make: |request| GAPS.draw(request),
};

pub(super) const RATIOS_ENTRY: FigureEntry = FigureEntry {
    name: "stage-gap-ratios",
    summary: "stage gap of chosen pairs by that of all candidates, over environment steps",
    input: INPUT,
    choices: &[],
    make: |request| RATIOS.draw(request),
};

/// The gaps themselves.
pub(crate) const GAPS: StageGaps = StageGaps {
    figure: "stage-gaps",
    lines: |chosen, pool| vec![("chosen", chosen), ("candidates", pool)],
    has_unit: true,
    y: "Stage gap",
    title: "Stage gap of chosen pairs and of all candidates over environment steps",
};

/// What choosing does to them: below 1 the chosen pairs lie closer than candidates do.
pub(crate) const RATIOS: StageGaps = StageGaps {
    figure: "stage-gap-ratios",
    lines: |chosen, pool| {
        let ratio = (pool > 0.0).then_some(("", chosen / pool));
        ratio.into_iter().collect()
    },
    has_unit: false,
    y: "Stage gap, chosen / candidates",
    title: "Stage gap of chosen pairs by that of all candidates over environment steps",
};

/// A figure of stage gaps over environment steps.
pub(crate) struct StageGaps {
    figure: &'static str,
    /// Lines and their heights, of the gaps of chosen pairs and of candidates in a session.
    lines: fn(f64, f64) -> Vec<(&'static str, f64)>,
    /// Whether nats and shares need panels of their own.
    has_unit: bool,
    y: &'static str,
    title: &'static str,
}

/// Method, setting where panels do not tell it, and which of its lines.
type Group = (String, Option<String>, &'static str);

/// The curve of each seed of a group.
type Seeds = Vec<(u64, Curve)>;

/// What is shown, and the unit where it needs to be told.
type Place = (Shown, &'static str);

/// Curves of each group by place.
struct Plan {
    groups: Vec<Group>,
    panels: Vec<(Place, Vec<Seeds>)>,
}

/// The gaps of a session.
struct Gaps {
    key: RunKey,
    setting: String,
    step: u64,
    chosen: f64,
    pool: f64,
}

impl Gaps {
    /// Those of a row that tells them. None of the first session: it is random, before anything is
    /// known of stages.
    fn of(row: Row) -> Option<Self> {
        let Content::Session(session) = row.content else {
            return None;
        };
        if session.session == 0 {
            return None;
        }
        Some(Self {
            setting: row.key.shown_setting(),
            key: row.key,
            step: session.step,
            chosen: session.stage_gap_chosen?,
            pool: session.stage_gap_pool?,
        })
    }
}

impl StageGaps {
    fn plan(&self, request: &Request) -> Result<Plan, FigureError> {
        let rows: Vec<Row> = read_rows(find(self.figure)?, request.sources)?;
        let sessions: Vec<Gaps> = rows.into_iter().filter_map(Gaps::of).collect();
        let is_split = is_by_setting(sessions.iter().map(|gaps| {
            let (task, method) = (gaps.key.task.as_str(), gaps.key.method.as_str());
            (task, method, gaps.setting.as_str())
        }));
        let mut points: BTreeMap<(Place, Group), BTreeMap<u64, Curve>> = BTreeMap::new();
        let (mut places, mut groups) = (Vec::new(), Vec::new());
        for gaps in sessions {
            let (key, setting) = (gaps.key, gaps.setting);
            let unit = if self.has_unit { unit(&key.method) } else { "" };
            let shown = Shown {
                task: key.task,
                setting: is_split.then(|| setting.clone()),
            };
            let place = (shown, unit);
            for (line, height) in (self.lines)(gaps.chosen, gaps.pool) {
                let of_line = (!is_split).then(|| setting.clone());
                let group = (key.method.clone(), of_line, line);
                groups.push(group.clone());
                let curves = points.entry((place.clone(), group)).or_default();
                let curve = curves.entry(key.seed).or_default();
                curve.push((gaps.step as f64, height));
            }
            places.push(place);
        }
        let groups = in_order_of_appearance(groups);
        let panels = in_order_of_appearance(places).into_iter().map(|place| {
            let curves = groups.iter().map(|group| {
                let seeds = points.remove(&(place.clone(), group.clone()));
                seeds.unwrap_or_default().into_iter().collect()
            });
            let curves = curves.collect();
            (place, curves)
        });
        let panels: Vec<_> = panels.collect();
        if groups.is_empty() {
            return Err(FigureError::NoRows {
                figure: self.figure,
                input: INPUT,
            });
        }
        Ok(Plan { groups, panels })
    }

    /// # Errors
    /// Without rows of stage gaps.
    pub(crate) fn draw(&self, request: &Request) -> Result<String, FigureError> {
        let plan = self.plan(request)?;
        let sheet = SeedSheet {
            groups: plan.key_names(),
            x: "Environment steps",
            y: self.y,
            is_rate: false,
            center: interquartile_mean,
            center_name: "interquartile mean",
            between: Between::Line,
        };
        let bundles = plan.bundles();
        let panel = |((shown, unit), groups): &(Place, Vec<Seeds>)| {
            let alone = |seeds: &Seeds| seeds.iter().map(|(_, curve)| curve.clone()).collect();
            let title = shown.title(plan.panels.iter().map(|((shown, _), _)| shown));
            let title = if unit.is_empty() {
                title
            } else {
                format!("{title} ({unit})")
            };
            apart(&title, groups.iter().map(alone).collect(), &bundles)
        };
        let panels: Vec<_> = plan.panels.iter().flat_map(panel).collect();
        Ok(sheet.draw(&panels, self.title))
    }

    /// Every point of the figure as CSV.
    ///
    /// # Errors
    /// As for drawing it.
    pub(crate) fn points(&self, request: &Request) -> Result<String, FigureError> {
        let plan = self.plan(request)?;
        let mut csv = String::from("task,method,setting,pairs,line,x,y\n");
        for ((shown, _), groups) in &plan.panels {
            let task = &shown.task;
            for ((method, setting, pairs), seeds) in plan.groups.iter().zip(groups) {
                let setting = setting.as_ref().or(shown.setting.as_ref());
                let setting = quoted(setting.map_or("", String::as_str));
                let named = |line: String| format!("{task},{method},{setting},{pairs},{line}");
                for (seed, curve) in seeds {
                    add_line(&mut csv, &named(format!("seed {seed}")), curve);
                }
                let curves: Vec<Curve> = seeds.iter().map(|(_, curve)| curve.clone()).collect();
                for (line, curve) in drawn_lines(&curves, interquartile_mean, Between::Line) {
                    add_line(&mut csv, &named(line.to_owned()), &curve);
                }
            }
        }
        Ok(csv)
    }
}

impl Plan {
    /// `STAIR, 80 answers, chosen (5 seeds)`
    fn key_names(&self) -> Vec<String> {
        let name = |(n, (method, setting, line)): (usize, &Group)| {
            let of_panels = self.panels.iter().map(|(_, groups)| groups[n].len());
            let n_seeds = seeds_in_words(of_panels.filter(|n_seeds| *n_seeds > 0));
            let name = line_name(method, setting.as_deref().unwrap_or_default());
            if line.is_empty() {
                format!("{name} ({n_seeds})")
            } else {
                format!("{name}, {line} ({n_seeds})")
            }
        };
        self.groups.iter().enumerate().map(name).collect()
    }

    /// All lines of a method, in one setting where panels do not tell it.
    fn bundles(&self) -> Vec<Bundle> {
        let mut bundles: Vec<Bundle> = Vec::new();
        for (n, (method, setting, _)) in self.groups.iter().enumerate() {
            let name = line_name(method, setting.as_deref().unwrap_or_default());
            match bundles.iter().position(|bundle| bundle.name == name) {
                Some(known) => bundles[known].lines.push(n),
                None => bundles.push(Bundle {
                    name,
                    lines: vec![n],
                }),
            }
        }
        bundles
    }
}

/// In what a method's gaps are told.
fn unit(method: &str) -> &'static str {
    let recipe = method::find(method).map(|entry| (entry.build)(&RunConfig::default()));
    let stage = recipe.ok().and_then(|recipe| recipe.stage);
    // A sampler that asks for a gap brings the quadrilateral along.
    stage.map_or("nats", StageApproximator::unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::Source;

    /// Two sessions of a run, as an experiment's results tell them.
    fn rows(method: &str, setting: &str, seed: u64) -> String {
        let row = |session: u32| {
            format!(
                "{{\"task\":\"go-fetch-return\",\"method\":\"{method}\",\"teacher\":\"oracle\",\
                 \"setting\":\"{setting}\",\"seed\":{seed},\"kind\":\"session\",\"session\":{session},\
                 \"step\":{},\"n_queries\":5,\"disagreement_chosen\":0.2,\"disagreement_pool\":0.1,\
                 \"stage_gap_chosen\":{session}.0,\"stage_gap_pool\":4.0,\"same_stage_chosen\":0.8}}\n",
                1_000 * session
            )
        };
        row(1) + &row(2)
    }

    fn drawn(gaps: &StageGaps, text: &str) -> (String, String) {
        let sources = [Source {
            name: "results.jsonl".into(),
            text: text.to_owned(),
        }];
        let request = Request {
            sources: &sources,
            ..Request::default()
        };
        (gaps.draw(&request).unwrap(), gaps.points(&request).unwrap())
    }

    fn n_seeds_drawn(svg: &str) -> usize {
        svg.matches("stroke-width=\"0.8\"").count()
    }

    #[test]
    fn a_key_tells_how_many_seeds_a_line_has() {
        let text = rows("stair", "", 1) + &rows("stair", "", 2);
        let (svg, _) = drawn(&GAPS, &text);
        for name in ["STAIR, chosen (2 seeds)", "STAIR, candidates (2 seeds)"] {
            assert!(svg.contains(name), "{name} is not in: {svg}");
        }
        assert!(svg.contains("Thick: interquartile mean."), "{svg}");
        let (svg, _) = drawn(&RATIOS, &text);
        assert!(svg.contains("STAIR (2 seeds)"), "{svg}");
    }

    #[test]
    fn several_methods_in_several_settings_have_a_panel_for_each_setting() {
        let mut text = String::new();
        for method in ["stair", "pebble"] {
            for setting in ["20 answers", "80 answers"] {
                text += &rows(method, setting, 1);
            }
        }
        let (svg, csv) = drawn(&GAPS, &text);
        for title in ["20 answers (nats)", "80 answers (nats)"] {
            assert!(svg.contains(&format!("go-fetch-return, {title}")), "{svg}");
        }
        assert!(svg.contains("STAIR, chosen (1 seed)"), "{svg}");
        assert_eq!(n_seeds_drawn(&svg), 2 * 2 * 2);
        assert!(
            csv.contains("go-fetch-return,pebble,80 answers,chosen,seed 1,2000,2\n"),
            "{csv}"
        );
    }

    /// As in `update-frequency`: one method in eight settings.
    #[test]
    fn more_lines_than_colours_have_panels_for_a_setting_each() {
        let text: String = (1..=8)
            .map(|n| rows("stair", &format!("setting {n}"), 1))
            .collect();
        let (svg, csv) = drawn(&GAPS, &text);
        for n in 1..=8 {
            let title = format!("go-fetch-return (nats): STAIR, setting {n}");
            assert!(svg.contains(&title), "{title} is not in: {svg}");
        }
        assert_eq!(n_seeds_drawn(&svg), 16, "chosen and candidates, once each");
        assert_eq!(csv.matches(",seed 1,1000,").count(), 16);

        let (ratios, _) = drawn(&RATIOS, &text);
        assert!(!ratios.contains("go-fetch-return: STAIR, setting 1"));
        assert!(ratios.contains("go-fetch-return: STAIR, setting 8"));
        assert_eq!(n_seeds_drawn(&ratios), 2 * 7, "each beside the first");

        let few: String = (1..=3)
            .map(|n| rows("stair", &format!("setting {n}"), 1))
            .collect();
        let (together, _) = drawn(&GAPS, &few);
        assert!(!together.contains("(nats): "));
    }
}
