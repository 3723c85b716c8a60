//! Transfer functions from CSV tables.

use super::{Colour, ColourSpace, TransferFunction};
use csv::{ReaderBuilder, StringRecord, Trim};

/// The accepted names of each column.
const NAMES: [&[&str]; 5] = [
    &["value", "scalar", "x"],
    &["red", "r", "rgb_r"],
    &["green", "g", "rgb_g"],
    &["blue", "b", "rgb_b"],
    &["opacity", "alpha", "a", "o"],
];

/// The index of each column. The opacity column is optional.
type Columns = [Option<usize>; 5];

/// A line: its number, value, colour and optional opacity.
struct Row {
    line: u64,
    value: f64,
    colour: Colour,
    opacity: Option<f64>,
}

/// Parses a table with value, red, green, blue and optional opacity in each line. A header may change the order of
/// columns.
pub(super) fn parse(text: &str) -> Result<TransferFunction, String> {
    let mut reader = ReaderBuilder::new();
    reader.has_headers(false).flexible(true).trim(Trim::All).comment(Some(b'#'));
    let (mut columns, mut rows) = (None, Vec::new());
    for record in reader.from_reader(text.as_bytes()).records() {
        let record = record.map_err(|e| e.to_string())?;
        let line = line(text, &record);
        match &columns {
            _ if record.iter().all(str::is_empty) => {}
            None if is_header(&record) => columns = Some(named(line, &record)?),
            None => rows.push(row(columns.insert(plain(&record)), line, &record)?),
            Some(columns) => rows.push(row(columns, line, &record)?),
        }
    }
    transfer_function(&rows)
}

fn transfer_function(rows: &[Row]) -> Result<TransferFunction, String> {
    let in_bytes = rows.iter().flat_map(|row| row.colour).any(|c| c > 1.0);
    let colours = rows.iter().map(|row| Ok((row.value, if in_bytes { from_bytes(row)? } else { row.colour })));
    let colours = colours.collect::<Result<Vec<_>, String>>()?;
    let opacities: Vec<_> = rows.iter().filter_map(|row| row.opacity.map(|a| (row.value, a))).collect();
    TransferFunction::from_points(colours, ColourSpace::Rgb, (!opacities.is_empty()).then_some(opacities), None)
}

/// The colour of a line in a table with colours of 0 to 255.
fn from_bytes(row: &Row) -> Result<Colour, String> {
    let wrong = |c: &&f64| !(0.0..=255.0).contains(*c) || c.fract() != 0.0;
    match row.colour.iter().find(wrong) {
        None => Ok(row.colour.map(|c| c / 255.0)),
        Some(c) => Err(at(row.line, &format!("colours of 0 to 1 or, in whole numbers, 0 to 255, not {c}"))),
    }
}

fn at(line: u64, expected: &str) -> String {
    format!("line {line}: expected {expected}")
}

/// The line number of a record. The record's own position is where the skipped lines before it begin.
fn line(text: &str, record: &StringRecord) -> u64 {
    let Some(position) = record.position() else { return 0 };
    let rest = text.get(position.byte() as usize..).unwrap_or_default();
    let skipped = rest.lines().take_while(|line| line.is_empty() || line.starts_with('#')).count();
    position.line() + skipped as u64
}

/// Whether no field is a number.
fn is_header(record: &StringRecord) -> bool {
    record.iter().all(|field| field.parse::<f64>().is_err())
}

/// The columns of a table without a header.
fn plain(record: &StringRecord) -> Columns {
    std::array::from_fn(|i| (i < 4 || i < record.len()).then_some(i))
}

/// The columns named by a header.
fn named(line: u64, header: &StringRecord) -> Result<Columns, String> {
    let find = |names: &[&str]| header.iter().position(|h| names.contains(&h.to_ascii_lowercase().as_str()));
    let columns = NAMES.map(find);
    match columns[..4].iter().position(Option::is_none) {
        None => Ok(columns),
        Some(lacking) => {
            let what = format!("value,red,green,blue or numbers; there is no column '{}'", NAMES[lacking][0]);
            Err(at(line, &what))
        }
    }
}

fn row(columns: &Columns, line: u64, record: &StringRecord) -> Result<Row, String> {
    let number = |i: usize| {
        let Some(field) = columns[i].and_then(|at| record.get(at)) else {
            let what = format!("value, red, green and blue{}", if columns[4].is_some() { ", and opacity" } else { "" });
            return Err(at(line, &format!("{what}, found {} field(s)", record.len())));
        };
        field.parse::<f64>().map_err(|_| at(line, &format!("a number for {}, not '{field}'", NAMES[i][0])))
    };
    let opacity = columns[4].map(|_| number(4)).transpose()?;
    Ok(Row { line, value: number(0)?, colour: [number(1)?, number(2)?, number(3)?], opacity })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_with_and_without_a_header() {
        let plain = parse("# a map\n-1, 0, 0, 1\n \n3, 1, 0, 0\n").expect("a table");
        assert_eq!((plain.range(), plain.colour(1.0), plain.opacity(1.0)), ((-1.0, 3.0), Some([0.5, 0.0, 0.5]), 0.5));
        let header = "Blue,more,SCALAR,RGB_r,g\n1,x,-1,0,0\n0,y,3,1,0";
        assert_eq!(parse(header).expect("a table"), plain);
        let bytes = parse("scalar,RGB_r,RGB_g,RGB_b\r\n-1,0,0,255\r\n3,255,0,0\r\n").expect("a table");
        assert_eq!(bytes, plain);
        let opaque = parse("-1,0,0,1,1\n3,1,0,0,0.5\n").expect("a table");
        assert_eq!((opaque.colour(1.0), opaque.opacity(1.0)), (plain.colour(1.0), 0.75));
    }

    #[test]
    fn errors_name_the_line() {
        let cases = [
            ("# nothing\n", "has 0 point(s) of colours"),
            ("0,0,0,0\n", "has 1 point(s) of colours"),
            ("value,red,green,blue\n", "has 0 point(s) of colours"),
            ("x,r,g\n0,0,0\n", "line 1: expected value,red,green,blue or numbers; there is no column 'blue'"),
            ("0,0,0,0\n1,1,1\n", "line 2: expected value, red, green and blue, found 3 field(s)"),
            ("0,0,0,0,1\n1,1,1,1\n", "line 2: expected value, red, green and blue, and opacity, found 4 field(s)"),
            ("0,0,0,0\n#\n1,1,one,1\n", "line 3: expected a number for green, not 'one'"),
            ("0,0,0,0\n1,1.5,1,1\n", "line 2: expected colours of 0 to 1 or, in whole numbers, 0 to 255, not 1.5"),
            ("0,0,0,0\n1,256,1,1\n", "0 to 255, not 256"),
            ("0,0,0,0\n1,-1,0,0\n", "point 2 of its colours has -1, where 0 to 1"),
            ("1,0,0,0\n0,1,1,1\n", "point 2 has 0 after 1"),
            ("0,0,0,0\n0,1,1,1\n", "all of its colours have the value 0"),
            ("0,0,0,0\ninf,1,1,1\n", "point 2 of its colours has the value inf, where a finite number"),
            ("nan,0,0,0\n1,1,1,1\n", "point 1 of its colours has the value NaN"),
            ("0,0,0,nan\n1,1,1,1\n", "point 1 of its colours has NaN, where 0 to 1"),
            ("0,0,0,0,0\n1,1,1,1,7\n", "point 2 of its opacities has 7, where 0 to 1"),
        ];
        for (text, words) in cases {
            let error = parse(text).expect_err(text);
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
