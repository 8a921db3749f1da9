package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{AttributeLayout, ColonnadeConfig, MapEncoding, TileGrid}
import colonnade.formats.Load

final class AttributeMapIO[T <: Data](config: ColonnadeConfig, layout: TileGrid, entry: T, tagBits: Int)
    extends Bundle {
  val load   = Flipped(Valid(new Load(config))) // only while no request is in flight
  val pixels = Flipped(new AttributeChannel(new MapPixel(layout), entry, tagBits))
}

/** A map with an entry (a colour or a normal) for each pixel. Responses come in the order of the requests. */
abstract class AttributeMap[T <: Data](config: ColonnadeConfig, layout: TileGrid, entry: T, tagBits: Int)
    extends Module {
  final val io = IO(new AttributeMapIO(config, layout, entry, tagBits))
}

object AttributeMap {

  /** A map of the environment in the configured encoding.
    *
    * @param name of the map in [[colonnade.formats.AttributeMemories]]
    */
  def apply[T <: Data](config: ColonnadeConfig, name: String, entry: T, tagBits: Int): AttributeMap[T] = {
    val layout = AttributeLayout.of(config)
    layout.config.encoding match {
      case MapEncoding.TwoLevel => new TwoLevelMap(config, layout, name, entry, tagBits)
      case MapEncoding.Slic     => new SlicMap(config, layout, name, entry, tagBits)
    }
  }
}
