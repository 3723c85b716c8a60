//! What formats call the types of numbers.

use wavesplat_core::base::stored::StoredType;

/// The names of types in a format, or their codes. Of several for one type, the first is written.
pub(crate) struct Types<K: 'static>(pub(crate) &'static [(StoredType, &'static [K])]);

impl<K: Copy + Default> Types<K> {
    /// The type of a name.
    pub(crate) fn stored<N: Copy>(&self, name: N) -> Option<StoredType>
    where
        K: PartialEq<N>,
    {
        self.0.iter().find(|(_, names)| names.iter().any(|own| *own == name)).map(|(ty, _)| *ty)
    }

    /// The name of a type that the format has.
    pub(crate) fn name(&self, ty: impl Into<StoredType>) -> K {
        let ty = ty.into();
        self.0.iter().find(|(own, _)| *own == ty).map_or_else(K::default, |(_, names)| names[0])
    }
}
