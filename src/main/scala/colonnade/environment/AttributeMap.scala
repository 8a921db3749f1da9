package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{AttributeLayout, ColonnadeConfig, TileGrid}
import colonnade.formats.Load

/** Ports of [[AttributeMap]]. */
final class AttributeMapIO[T <: Data](config: ColonnadeConfig, layout: TileGrid, entry: T, tagBits: Int)
    extends Bundle {
  val load   = Flipped(Valid(new Load(config)))
  val pixels = Flipped(new AttributeChannel(new MapPixel(layout), entry, tagBits))
}

/** A map with an entry (a colour or a normal) for each pixel, in one of the encodings. */
abstract class AttributeMap[T <: Data](config: ColonnadeConfig, layout: TileGrid, entry: T, tagBits: Int)
    extends Module {
  final val io = IO(new AttributeMapIO(config, layout, entry, tagBits))
}

object AttributeMap {

  /** A map in the configured encoding.
    *
    * @param name of the map in [[colonnade.formats.AttributeMemories]]
    */
  def apply[T <: Data](config: ColonnadeConfig, name: String, entry: T, tagBits: Int): AttributeMap[T] =
    if (AttributeLayout.of(config).isSliding) new SlidingMap(config, name, entry, tagBits)
    else new TwoLevelMap(config, AttributeLayout.of(config), name, entry, tagBits)
}
