package colonnade.config

/** Builds the case classes of a configuration from complete JSON. */
private[config] object ConfigPickler extends upickle.AttributeTagged {
  implicit override def OptionReader[T: Reader]: Reader[Option[T]] =
    new Reader.Delegate[Any, Option[T]](implicitly[Reader[T]].map(Some(_))) {
      override def visitNull(index: Int): Option[T] = None
    }

  implicit private val array:     Reader[ArrayConfig]                   = macroR
  implicit private val precision: Reader[PrecisionConfig]               = macroR
  implicit private val geometry:  Reader[GeometryConfig]                = macroR
  implicit private val units:     Reader[UnitsConfig]                   = macroR
  implicit private val cache:     Reader[SceneCacheConfig]              = macroR
  implicit private val memory:    Reader[ColumnBvhMemoryConfig]         = macroR
  implicit private val encoding:  Reader[MapEncoding]                   = StringReader.map(MapEncoding.named(_).get)
  implicit private val maps:      Reader[PhysicalAttributeMemoryConfig] = macroR
  implicit private val frame:     Reader[FrameConfig]                   = macroR
  implicit val config:            Reader[ColonnadeConfig]               = macroR
}
