package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, DecoupledIO}
import colonnade.config.ColonnadeConfig

/** The first pixel of a square of `frame.tileSize`, or of one of the squares of [[TileDivider]]. */
sealed class Tile(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A tile, or a square of one, that meets the object. */
final class ObjectTile(config: ColonnadeConfig) extends Tile(config) {

  /** The bounds of the whole tile. */
  val edgeValues = EdgeValues(config)
}

object Tile {
  def apply(config: ColonnadeConfig, kind: TileKind.Value): Tile =
    if (kind == TileKind.OfObject) new ObjectTile(config) else new Tile(config)

  /** Levels of the Morton code of a pixel in its tile. */
  def pixelLevels(config: ColonnadeConfig): Int = log2Ceil(config.frame.tileSize)

  /** Levels of the Morton code of a tile, for any frame that the registers can hold. */
  def tileLevels(config: ColonnadeConfig): Int = (config.numbers.coordinateBits - pixelLevels(config)).max(1)
}

/** What the pixels of a tile may show. */
object TileKind extends Enumeration {
  val OfObject      = Value // the object in some pixel
  val OfEnvironment = Value // the environment in some pixel, the object in none
  val OfBackground  = Value // the background only

  /** The bounds of a device. */
  def all(config: ColonnadeConfig): Seq[TileKind.Value] =
    values.toSeq.filter(kind => kind != OfEnvironment || config.hasEnvironment)
}

/** Tiles for a column, by kind. */
final class ColumnTiles(config: ColonnadeConfig) extends Bundle {
  val ofObject      = Decoupled(new ObjectTile(config))
  val ofEnvironment = Option.when(config.hasEnvironment)(Decoupled(new Tile(config)))
  val ofBackground  = Decoupled(new Tile(config))

  def apply(kind: TileKind.Value): DecoupledIO[Tile] = kind match {
    case TileKind.OfObject      => ofObject
    case TileKind.OfEnvironment => ofEnvironment.get
    case TileKind.OfBackground  => ofBackground
  }
}
