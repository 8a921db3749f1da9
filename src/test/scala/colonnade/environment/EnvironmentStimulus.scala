package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.Packed
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats._

import scala.util.Random

/** Requests to an environment's maps, with the model's responses. Some tiles point beyond their heap. */
final class EnvironmentStimulus(config: ColonnadeConfig, random: Random) {
  private val layout = AttributeLayout.of(config)
  private val image  = new EnvironmentImage(config, random, illegal = 0.3)

  /** Fills all memories. Adds loads to other targets and beyond the depths, which must have no effect. */
  def load(port: Valid[Load], clock: Clock): Unit = {
    def put(target: Int, address: Int, word: BigInt): Unit = {
      port.bits.target.poke(target)
      port.bits.address.poke(address)
      port.bits.record.poke(word)
      clock.step()
    }
    val others = Seq(LoadTarget.firstAttributes - 1, (1 << LoadTarget.bits(config)) - 1)
    clock.setTimeout(0)
    port.valid.poke(true)
    for (memory <- AttributeMemories(config); (word, address) <- image.words(memory.name).zipWithIndex)
      put(memory.target, address, word)
    for (target <- others if AttributeMemories(config).forall(_.target != target); address <- 0 until 16)
      put(target, address, BigInt(port.bits.record.getWidth, random))
    val addresses = 1 << port.bits.address.getWidth
    for (memory <- AttributeMemories(config); beyond <- Seq.fill(24)(random.nextInt(addresses)) :+ memory.depth)
      if (beyond >= memory.depth && beyond < addresses)
        put(memory.target, beyond, BigInt(port.bits.record.getWidth, random))
    port.valid.poke(false)
  }

  def albedo(count: Int): Seq[Exchange] = colours("albedo", new AlbedoEntry, Seq("r", "g", "b"), count)

  def normals(count: Int): Seq[Exchange] = colours("normal", new NormalEntry, Seq("x", "y", "z"), count)

  /** Tiles and cells. */
  def cells(count: Int): Seq[Exchange] = {
    val positions = pixels(count)
    val tiles     = ask("tile", positions)
    val cells     = ask("cell", positions).zip(tiles).map { case (cell, tile) => Seq(tile.head, BigInt(1), cell.head) }
    val beyond    = Seq("tile", "cell").map(kind => kind -> ask(kind, positions).map(_.last)).toMap
    val names     = Seq("cellLog", "count", "ids[0]", "ids[1]", "ids[2]", "ids[3]")
    val req       = new Packed(new CellRequest(layout))
    val resp      = new Packed(new CellResponse(layout))
    for (((x, y), index) <- positions.zipWithIndex) yield {
      val wholeTile = random.nextBoolean()
      val isIllegal = beyond(if (wholeTile) "tile" else "cell")(index)
      Exchange(
        req.pack(Map("pixel.x" -> x, "pixel.y" -> y, "wholeTile" -> (if (wholeTile) 1 else 0))),
        resp.pack(names.zip(if (wholeTile) tiles(index) else cells(index)).toMap) | (isIllegal << resp.width)
      )
    }
  }

  /** Planes of the table, without colours and normals, and bounding planes. */
  def planes(count: Int): Seq[Exchange] = {
    val names     = Seq("plane.a", "plane.b", "plane.c", "plane.exponent")
    val all       = names ++ Seq("albedo.r", "albedo.g", "albedo.b", "normal.x", "normal.y", "normal.z")
    val req       = new Packed(new PlaneRequest(layout))
    val resp      = new Packed(new BoundingPlaneEntry)
    val planeMask = (BigInt(1) << (new Plane).getWidth) - 1
    def known(kind: String, size: Int): Seq[Seq[BigInt]] = image.ask(kind, Seq.tabulate(size)(i => Seq(BigInt(i))))
    val (table, bounding) = (known("plane", layout.config.planes), known("boundingPlane", layout.config.boundingPlanes))
    Seq.fill(count) {
      val isBoundingPlane = random.nextInt(3) == 0
      val index           = random.nextInt(if (isBoundingPlane) bounding.size else table.size)
      val values          = if (isBoundingPlane) all.zip(bounding(index)) else names.zip(table(index))
      Exchange(
        req.pack(Map("isBoundingPlane" -> (if (isBoundingPlane) 1 else 0), "index" -> index)),
        resp.pack(values.toMap),
        mask = if (isBoundingPlane) -1 else planeMask
      )
    }
  }

  /** Corners first. */
  private def pixels(count: Int): Seq[(Int, Int)] = (image.corners ++ Seq.fill(count)(image.pixel())).take(count)

  private def ask(kind: String, pixels: Seq[(Int, Int)]): Seq[Seq[BigInt]] =
    image.ask(kind, pixels.map { case (x, y) => Seq(BigInt(x), BigInt(y)) })

  private def colours(kind: String, entry: Data, components: Seq[String], count: Int): Seq[Exchange] = {
    val positions = pixels(count)
    val req       = new Packed(new MapPixel(layout))
    val resp      = new Packed(entry)
    positions.zip(ask(kind, positions)).map { case ((x, y), values) =>
      val found = resp.pack(components.zip(values).toMap) | (values.last << resp.width)
      Exchange(req.pack(Map("x" -> x, "y" -> y)), found)
    }
  }
}
