package colonnade.frame

import chisel3._
import chiseltest._
import colonnade.formats.FrameSettings

import scala.util.Random

/** An outline in a spec: a rectangle (x0, y0, x1, y1) and half-planes a·x + b·y + c ≥ 0. */
final case class Outline(rect: Seq[Int], edges: Seq[(Int, Int, Int)]) {
  def poke(frame: FrameSettings): Unit = {
    val ports = frame.objectRect
    Seq(ports.x0, ports.y0, ports.x1, ports.y1).zip(rect).foreach { case (port, value) => port.poke(value) }
    for ((port, (x, y, offset)) <- frame.objectOutline.zip(edges)) {
      port.x.poke(x)
      port.y.poke(y)
      port.offset.poke(offset)
    }
  }

  /** A pixel of the square is in the rectangle, and for each half-plane one pixel is in it. */
  def meets(size: Int)(x: Int, y: Int): Boolean = {
    val Seq(x0, y0, x1, y1) = rect
    (x until x + size).exists(px => px >= x0 && px < x1) && (y until y + size).exists(py => py >= y0 && py < y1) &&
    highest(size)(x, y).forall(_ >= 0)
  }

  /** The edge functions, each one at the corner of the square where it is highest. */
  private def highest(size: Int)(x: Int, y: Int): Seq[Long] = {
    val corners = for (cx <- Seq(x, x + size - 1); cy <- Seq(y, y + size - 1)) yield (cx, cy)
    edges.map(edge => corners.map { case (cx, cy) => edge._1.toLong * cx + edge._2.toLong * cy + edge._3 }.max)
  }

  /** What [[EdgeValues]] says of a tile that meets the outline. */
  def edgeValues(size: Int)(x: Int, y: Int): Seq[Long] = highest(size)(x, y).map(_.min(4096L * size - 1))

  /** Pokes them for the tile of a pixel. */
  def pokeValues(ports: Vec[UInt], size: Int)(x: Int, y: Int): Unit =
    ports.zip(edgeValues(size)(x / size * size, y / size * size)).foreach { case (port, value) =>
      port.poke(value.max(0))
    }
}

object Outline {
  private val noEdge = (0, 0, 0)

  /** Half of its edges go through one of some pixels, where one step more or less decides; the others cut nothing off. */
  def random(random: Random, pixels: Seq[(Int, Int)], limit: Int): Outline = Outline(
    if (random.nextInt(8) == 0) Seq(9, 9, 9, 40)
    else Seq(random.nextInt(64), random.nextInt(64), limit - 9, limit - 1),
    Seq.fill(6) {
      def normal() = if (random.nextInt(8) == 0) -2048 else random.nextInt(4096) - 2048
      val (x, y)   = (normal(), normal())
      val (px, py) = pixels(random.nextInt(pixels.size))
      if (random.nextBoolean()) noEdge else (x, y, -(x * px + y * py) - random.nextInt(2))
    }
  )

  /** An outline that nothing of a frame is outside of, but for one edge. */
  def within(size: (Int, Int), edge: (Int, Int, Int) = noEdge): Outline =
    Outline(Seq(0, 0, size._1, size._2), edge +: Seq.fill(5)(noEdge))
}
