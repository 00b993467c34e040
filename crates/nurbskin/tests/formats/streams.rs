//! Streams in and out, the headers of CAD files, and units of conversions.

use nurbskin::io::cad::{CadFormat, read_cad_bytes};
use nurbskin::io::{Timestamp, read_scan, write_scan_to};
use nurbskin::pipeline::{
    ConvertOptions, Options, OutputOptions, SURFACE_FORMATS, Source, Target, check_outputs,
    check_targets, convert_from, default_output, deviation_from, enrich_from, fit_from, info_from,
    rarefy_from, refuse_existing, view_from,
};
use nurbskin::progress::Silent;
use nurbskin::{DVec3, Unit};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A shallow bowl of 12 x 12 points in this unit, as text.
fn bowl(scale: f64) -> String {
    let mut text = String::new();
    for j in 0..12 {
        for i in 0..12 {
            let [x, y] = [i, j].map(|k| f64::from(k) - 5.5);
            let z = 0.05 * (x * x + y * y);
            writeln!(text, "{} {} {}", x * scale, y * scale, z * scale).unwrap();
        }
        text.push('\n');
    }
    text
}

fn dated() -> Options {
    Options {
        output: OutputOptions {
            author: "A. Müller".into(),
            organization: "Works & Sons".into(),
            time: Some(Timestamp::new(2007, 1, 29, 10, 54, 34).unwrap()),
            ..OutputOptions::default()
        },
        ..Options::default()
    }
}

#[test]
fn a_fit_goes_from_a_stream_to_a_stream() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bowl.xyz");
    std::fs::write(&file, bowl(1.0)).unwrap();
    let stream = Source::stream("standard input", bowl(1.0).as_bytes(), Some("xyz")).unwrap();
    for format in ["step", "igs", "stl", "ply", "glb"] {
        let target = Target::Memory(format.into());
        let outcome = fit_from(&stream, std::slice::from_ref(&target), &dated(), &Silent).unwrap();
        assert_eq!(outcome.input.path, "standard input");
        let [output] = &outcome.outputs[..] else {
            panic!("{:?}", outcome.outputs);
        };
        let content = output.content.as_ref().unwrap();
        assert_eq!(
            (output.path.as_path(), output.bytes),
            (Path::new("-"), content.len() as u64)
        );
        // The check of a CAD file reads what was made.
        if let Some(known) = CadFormat::from_extension(format) {
            assert!(outcome.check.as_ref().unwrap().reads_back, "{format}");
            assert_eq!(output.format, known.name());
        }
        let path = folder.path().join(format!("bowl.{format}"));
        let to_file = [Target::File(path.clone())];
        let outcome = fit_from(&Source::file(&file), &to_file, &dated(), &Silent).unwrap();
        assert!(!outcome.outputs[0].replaced);
        let same = std::fs::read(&path).unwrap().len().abs_diff(content.len());
        // Names of the product and the file are all that may differ.
        assert!(same < 200, "{format}: {same}");
        // Under a name in memory, nothing may.
        let named = [Target::Named(format!("bowl.{format}").into())];
        let outcome = fit_from(&Source::file(&file), &named, &dated(), &Silent).unwrap();
        assert_eq!(
            outcome.outputs[0].path,
            Path::new(&format!("bowl.{format}"))
        );
        let content = outcome.outputs[0].content.as_deref();
        assert_eq!(
            content,
            Some(&std::fs::read(&path).unwrap()[..]),
            "{format}"
        );
        let outcome = fit_from(&Source::file(&file), &to_file, &dated(), &Silent).unwrap();
        assert!(outcome.outputs[0].replaced, "{format}");
    }
}

#[test]
fn headers_tell_who_and_when() {
    let source = Source::bytes("bowl", bowl(1.0).into_bytes(), Some("xyz")).unwrap();
    let text_of = |format: &str, options: &Options| {
        let target = [Target::Memory(format.into())];
        let outcome = fit_from(&source, &target, options, &Silent).unwrap();
        outcome.outputs.into_iter().next().unwrap().content.unwrap()
    };
    let step = text_of("step", &dated());
    let text = String::from_utf8_lossy(&step);
    assert!(
        text.contains(
            "FILE_NAME('','2007-01-29T10:54:34',('A. M\\X2\\00FC\\X0\\ller'),('Works & Sons'),"
        ),
        "{}",
        &text[..400]
    );
    let header = read_cad_bytes(&step, Path::new("a")).unwrap().header;
    assert_eq!(
        [&*header.author, &*header.organization],
        ["A. Müller", "Works & Sons"]
    );
    assert_eq!(header.date, "2007-01-29T10:54:34");
    assert!(header.system.starts_with("nurbskin "), "{header:?}");
    let iges = text_of("igs", &dated());
    let header = read_cad_bytes(&iges, Path::new("a")).unwrap().header;
    assert_eq!(
        [&*header.author, &*header.organization],
        ["A. M_ller", "Works & Sons"]
    );
    assert_eq!(header.date, "2007-01-29T10:54:34");
    // Equal dates, equal bytes; without one, it is today's.
    assert_eq!(step, text_of("step", &dated()));
    let before = Timestamp::now().unwrap();
    let undated = text_of("step", &Options::default());
    let date = read_cad_bytes(&undated, Path::new("a"))
        .unwrap()
        .header
        .date;
    assert!(
        before.iso() <= date && date <= Timestamp::now().unwrap().iso(),
        "{date}"
    );
    // Info tells it, and a conversion hands it on.
    let source = Source::bytes("a", step, None).unwrap();
    let found = serde_json::to_value(info_from(&source, &Silent).unwrap()).unwrap();
    assert_eq!(found["header"]["author"], "A. Müller");
    let target = [Target::Memory("igs".into())];
    let converted = convert_from(&source, &target, &ConvertOptions::default(), &Silent).unwrap();
    let content = converted.outputs[0].content.as_ref().unwrap();
    let header = read_cad_bytes(content, Path::new("a")).unwrap().header;
    assert_eq!(header.organization, "Works & Sons");
}

#[test]
fn a_scan_in_metres_becomes_one_in_millimetres() {
    let source = Source::bytes("bowl", bowl(1e-3).into_bytes(), Some("xyz")).unwrap();
    let target = [Target::Memory("ply".into())];
    let convert = |unit, to_unit| {
        let options = ConvertOptions {
            unit,
            to_unit,
            ..ConvertOptions::default()
        };
        let done = convert_from(&source, &target, &options, &Silent).unwrap();
        let content = done.outputs[0].content.clone().unwrap();
        let scan = nurbskin::io::read_scan_from("a", content, Some("ply")).unwrap();
        (scan.points[0].x, done.warnings)
    };
    let (x, warnings) = convert(Some(Unit::Metre), Some(Unit::Millimetre));
    assert!(
        (x + 5.5).abs() < 1e-9 && warnings.is_empty(),
        "{x} {warnings:?}"
    );
    let (x, warnings) = convert(None, Some(Unit::Millimetre));
    assert!((x + 5.5e-3).abs() < 1e-12);
    let assumed = |warning: &String| warning.contains("if its numbers are in mm");
    assert!(warnings.iter().any(assumed), "{warnings:?}");
    let (x, warnings) = convert(Some(Unit::Metre), None);
    assert!((x + 5.5e-3).abs() < 1e-12 && warnings.is_empty());
}

#[test]
fn a_cad_file_is_no_scan() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("part.step");
    std::fs::write(&part, "ISO-10303-21;").unwrap();
    let wanted = format!(
        "{} is a CAD file, not a scan: use `check`, `deviation` or `convert`",
        part.display()
    );
    assert_eq!(default_output(&part), part);
    let paths = [part.clone()];
    let before = check_outputs(&paths, &paths, &SURFACE_FORMATS).unwrap_err();
    assert_eq!(before.to_string(), wanted);
    assert_eq!(read_scan(&part).unwrap_err().to_string(), wanted);
    let scan = Source::file(&part);
    let said = deviation_from(&scan, &scan, &Default::default(), &Silent).unwrap_err();
    assert!(said.to_string().contains("not a scan"), "{said}");
}

#[test]
fn default_outputs_replace_nothing() {
    for (scan, output) in [
        ("part.ply", "part.step"),
        ("part.ply.gz", "part.step"),
        ("a/part.v2.xyz.GZ", "a/part.v2.step"),
        ("part", "part.step"),
    ] {
        assert_eq!(default_output(scan), PathBuf::from(output), "{scan}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.step");
    refuse_existing(std::slice::from_ref(&path)).unwrap();
    std::fs::write(&path, "the nominal").unwrap();
    let said = refuse_existing(&[path]).unwrap_err().to_string();
    assert!(
        said.contains("exists already") && said.contains("--force"),
        "{said}"
    );
}

#[test]
fn no_call_writes_over_what_it_reads() {
    let folder = tempfile::tempdir().unwrap();
    let scan = folder.path().join("scan.ply");
    let cad = folder.path().join("part.step");
    // Not even read: neither is what its name says.
    for path in [&scan, &cad] {
        std::fs::write(path, "the only copy").unwrap();
    }
    let (source, nominal) = (Source::file(&scan), Source::file(&cad));
    let target = Target::File(scan.clone());
    let targets = std::slice::from_ref(&target);
    let reports = vec![scan.clone()];
    let options = Options::default();
    let reporting = Options {
        output: OutputOptions {
            reports: reports.clone(),
            ..OutputOptions::default()
        },
        ..Options::default()
    };
    let compared = nurbskin::pipeline::DeviationOptions {
        reports,
        ..Default::default()
    };
    let refusals = [
        fit_from(&source, targets, &options, &Silent).err(),
        fit_from(&source, &[], &reporting, &Silent).err(),
        deviation_from(&source, &nominal, &compared, &Silent).err(),
        convert_from(&source, targets, &ConvertOptions::default(), &Silent).err(),
        rarefy_from(&source, &target, &options, &Silent).err(),
        enrich_from(&source, &target, &options, &Silent).err(),
        view_from(&source, Some(&scan), None, &Silent).err(),
    ];
    for (k, refusal) in refusals.into_iter().enumerate() {
        let said = refusal.unwrap().to_string();
        assert!(said.contains("is also an input"), "{k}: {said}");
    }
    for path in [&scan, &cad] {
        assert_eq!(std::fs::read_to_string(path).unwrap(), "the only copy");
    }
}

#[test]
fn streams_that_cannot_be_written_are_refused() {
    let memory = |format: &str| Target::Memory(format.into());
    let said = |outputs: &[Target]| {
        check_targets(&[], outputs, &SURFACE_FORMATS)
            .unwrap_err()
            .to_string()
    };
    assert!(said(&[memory("foo")]).contains("unknown format `foo`"));
    assert!(said(&[memory("step"), memory("igs")]).contains("only one output"));
    assert!(check_targets(&[], &[memory("STEP")], &SURFACE_FORMATS).is_ok());
    // Names distinguish several outputs.
    let named = |name: &str| Target::Named(name.into());
    assert!(said(&[named("a.foo")]).contains("a.foo: unknown extension .foo"));
    let two = [named("a.step"), named("a.igs")];
    assert!(check_targets(&[], &two, &SURFACE_FORMATS).is_ok());
    let said = check_outputs(&[], &["a.foo".into()], &SURFACE_FORMATS).unwrap_err();
    assert!(
        said.to_string()
            .starts_with("a.foo: unknown extension .foo; use one of"),
        "{said}"
    );
    let scan = nurbskin::scan::Scan {
        points: vec![DVec3::ONE],
        ..Default::default()
    };
    let mut out = Vec::new();
    write_scan_to(&mut out, "standard output", "xyz", &scan).unwrap();
    assert!(!out.is_empty());
    assert!(write_scan_to(&mut out, "standard output", "stl", &scan).is_err());
}
