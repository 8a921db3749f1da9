package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.Packed
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats._

import scala.util.Random

/** Questions about a room's maps, some of whose tiles point beyond their heap, and what the model answers. */
final class RoomDialogue(config: ColonnadeConfig, random: Random) {
  private val layout = AttributeLayout.of(config)
  private val image  = new RoomImage(config, random, illegal = 0.3)

  /** Fills all memories; loads for others and beyond the depths, too, which change nothing. */
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
    val asked    = pixels(count)
    val tiles    = ask("tile", asked)
    val cells    = ask("cell", asked).zip(tiles).map { case (cell, tile) => Seq(tile.head, BigInt(1), cell.head) }
    val beyond   = Seq("tile", "cell").map(kind => kind -> ask(kind, asked).map(_.last)).toMap
    val names    = Seq("cellLog", "count", "ids[0]", "ids[1]", "ids[2]", "ids[3]")
    val question = new Packed(new CellQuestion(layout))
    val answer   = new Packed(new CellAnswer(layout))
    for (((x, y), index) <- asked.zipWithIndex) yield {
      val wholeTile = random.nextBoolean()
      val isIllegal = beyond(if (wholeTile) "tile" else "cell")(index)
      Exchange(
        question.pack(Map("pixel.x" -> x, "pixel.y" -> y, "wholeTile" -> (if (wholeTile) 1 else 0))),
        answer.pack(names.zip(if (wholeTile) tiles(index) else cells(index)).toMap) | (isIllegal << answer.width)
      )
    }
  }

  /** Planes of the table, whose colours and normals say nothing, and of the shell. */
  def planes(count: Int): Seq[Exchange] = {
    val names     = Seq("plane.a", "plane.b", "plane.c", "plane.exponent")
    val all       = names ++ Seq("albedo.r", "albedo.g", "albedo.b", "normal.x", "normal.y", "normal.z")
    val question  = new Packed(new PlaneQuestion(layout))
    val answer    = new Packed(new ShellEntry)
    val planeMask = (BigInt(1) << (new Plane).getWidth) - 1
    def known(kind: String, size: Int): Seq[Seq[BigInt]] = image.ask(kind, Seq.tabulate(size)(i => Seq(BigInt(i))))
    val (table, shell) = (known("plane", layout.config.planes), known("shell", layout.config.shellPlanes))
    Seq.fill(count) {
      val isShell = random.nextInt(3) == 0
      val index   = random.nextInt(if (isShell) shell.size else table.size)
      val values  = if (isShell) all.zip(shell(index)) else names.zip(table(index))
      Exchange(
        question.pack(Map("isShell" -> (if (isShell) 1 else 0), "index" -> index)),
        answer.pack(values.toMap),
        mask = if (isShell) -1 else planeMask
      )
    }
  }

  /** Corners first. */
  private def pixels(count: Int): Seq[(Int, Int)] = (image.corners ++ Seq.fill(count)(image.pixel())).take(count)

  private def ask(kind: String, pixels: Seq[(Int, Int)]): Seq[Seq[BigInt]] =
    image.ask(kind, pixels.map { case (x, y) => Seq(BigInt(x), BigInt(y)) })

  private def colours(kind: String, entry: Data, components: Seq[String], count: Int): Seq[Exchange] = {
    val asked    = pixels(count)
    val question = new Packed(new MapPixel(layout))
    val answer   = new Packed(entry)
    asked.zip(ask(kind, asked)).map { case ((x, y), values) =>
      val found = answer.pack(components.zip(values).toMap) | (values.last << answer.width)
      Exchange(question.pack(Map("x" -> x, "y" -> y)), found)
    }
  }
}
