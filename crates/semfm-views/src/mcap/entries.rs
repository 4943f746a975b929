//! A struct as the entries of a metadata record, which are text: numbers as their decimal digits,
//! truth as `true` and `false`. One struct with serde's derives is what writer and reader share.

use std::collections::{BTreeMap, btree_map};
use std::fmt;
use std::str::FromStr;

use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Expected, MapAccess, Unexpected, Visitor,
};
use serde::{Serialize, forward_to_deserialize_any};

/// The entries of a record.
pub(super) type Entries = BTreeMap<String, String>;

/// A struct's fields as entries.
///
/// # Panics
/// For a struct that holds anything but text, numbers and truth values.
pub(super) fn to_entries(record: &impl Serialize) -> Entries {
    let value = serde_json::to_value(record).expect("fields of a record have values of JSON");
    let serde_json::Value::Object(fields) = value else { panic!("a record is a struct") };
    fields.into_iter().map(|(key, value)| (key, as_text(value))).collect()
}

fn as_text(value: serde_json::Value) -> String {
    match value {
        serde_json::Value::String(text) => text,
        other => other.to_string(),
    }
}

/// A struct out of entries.
///
/// # Errors
/// [`EntryError`] for a key that is missing or whose text is not what the field holds.
pub(super) fn from_entries<T: DeserializeOwned>(entries: &Entries) -> Result<T, EntryError> {
    T::deserialize(Record { left: entries.iter(), current: None })
}

/// The entry at fault.
#[derive(Debug)]
pub(super) struct EntryError {
    pub key: String,
    pub expected: String,
    pub found: String,
}

impl fmt::Display for EntryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "key `{}`: expected {}, found {}", self.key, self.expected, self.found)
    }
}

impl std::error::Error for EntryError {}

impl serde::de::Error for EntryError {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { key: String::new(), expected: message.to_string(), found: "another".to_owned() }
    }

    fn missing_field(key: &'static str) -> Self {
        let (expected, found) = ("a value".to_owned(), "nothing".to_owned());
        Self { key: key.to_owned(), expected, found }
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let found = match found {
            Unexpected::Str(text) => text.to_owned(),
            other => other.to_string(),
        };
        Self { key: String::new(), expected: expected.to_string(), found }
    }
}

/// Reads entries one after the other, and names the key in what goes wrong with its text.
struct Record<'a> {
    left: btree_map::Iter<'a, String, String>,
    current: Option<(&'a str, &'a str)>,
}

impl<'de> Deserializer<'de> for Record<'de> {
    type Error = EntryError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, EntryError> {
        visitor.visit_map(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option
        unit unit_struct newtype_struct seq tuple tuple_struct map struct enum identifier
        ignored_any
    }
}

impl<'de> MapAccess<'de> for Record<'de> {
    type Error = EntryError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, EntryError> {
        self.current = self.left.next().map(|(key, text)| (key.as_str(), text.as_str()));
        match self.current {
            None => Ok(None),
            Some((key, _)) => seed.deserialize(StrDeserializer::<EntryError>::new(key)).map(Some),
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(
        &mut self,
        seed: V,
    ) -> Result<V::Value, EntryError> {
        let (key, text) = self.current.unwrap_or_default();
        seed.deserialize(Text(text)).map_err(|error| EntryError { key: key.to_owned(), ..error })
    }
}

/// One entry's text, read as what the field holds.
struct Text<'a>(&'a str);

impl Text<'_> {
    fn parse<T: FromStr>(&self, expected: &str) -> Result<T, EntryError> {
        self.0.parse().map_err(|_| EntryError {
            key: String::new(),
            expected: expected.to_owned(),
            found: self.0.to_owned(),
        })
    }
}

impl<'de> Deserializer<'de> for Text<'de> {
    type Error = EntryError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, EntryError> {
        visitor.visit_str(self.0)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, EntryError> {
        visitor.visit_bool(self.parse("`true` or `false`")?)
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, EntryError> {
        visitor.visit_u32(self.parse("a whole number")?)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, EntryError> {
        visitor.visit_u64(self.parse("a whole number")?)
    }

    forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u128 f32 f64 char str string bytes byte_buf option
        unit unit_struct newtype_struct seq tuple tuple_struct map struct enum identifier
        ignored_any
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Example {
        name: String,
        seed: u64,
        #[serde(default)]
        checked: bool,
        #[serde(flatten)]
        more: Entries,
    }

    fn entries(pairs: &[(&str, &str)]) -> Entries {
        pairs.iter().map(|&(key, text)| (key.to_owned(), text.to_owned())).collect()
    }

    #[test]
    fn a_struct_comes_back_from_its_entries() {
        let written = entries(&[
            ("checked", "true"),
            ("name", "a"),
            ("seed", "18446744073709551615"),
            ("x", "7"),
        ]);
        let example: Example = from_entries(&written).unwrap();
        assert_eq!((example.seed, example.more["x"].as_str()), (u64::MAX, "7"));
        assert_eq!(to_entries(&example), written);
    }

    #[test]
    fn an_entry_at_fault_is_named_with_what_it_should_be() {
        for (pairs, expected) in [
            (&[("name", "a")][..], "key `seed`: expected a value, found nothing"),
            (&[("name", "a"), ("seed", "-1")], "key `seed`: expected a whole number, found -1"),
        ] {
            let error = from_entries::<Example>(&entries(pairs)).unwrap_err();
            assert_eq!(error.to_string(), expected);
        }
    }
}
