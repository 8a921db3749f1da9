package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.PathConfig
import colonnade.formats.{Gather, PixelPosition, SamplePoint}

/** Asks for the sample point of a context, and whether rough metal is lit by its lobe. Both come in the next cycle. */
final class SamplePort(config: PathConfig) extends Bundle {
  val read    = Valid(Context(config))
  val point   = Input(new SamplePoint)
  val hasLobe = Input(Bool()) // the path has rays left to gather, or the frame gathers none
  val isOn    = Input(Bool()) // the frame gathers light; constant in it

  /** In the next cycle: the point is for a mirror or glass; for the back of a triangle. */
  val isBounce = Output(Bool())
  val backSide = Output(Bool())
}

/** A context and its pixel. */
final class PixelOfContext(config: PathConfig) extends Bundle {
  val context = Context(config)
  val pixel   = new PixelPosition(config.device)
}

final class SamplePointsIO(config: PathConfig) extends Bundle {
  val gather = Input(new Gather)
  val pixel  = Flipped(Valid(new PixelOfContext(config))) // a context that gets a pixel
  val count  = Input(UInt(Gather.countBits.W))            // of rays gathered so far; in the cycle of the point
  val port   = Flipped(new SamplePort(config))
}

/** The sample points of gathered rays: the frame's for the path's next ray, xor the pixel's: docs/gather.md.
  * Mirrors and glass have other rays' points.
  */
final class SamplePoints(config: PathConfig) extends Module {
  val io = IO(new SamplePointsIO(config))

  private val points = ContextTable(config, new SamplePoint)
  private val start  = io.pixel.bits
  when(io.pixel.valid) { points.write(start.context, SamplePoints.ofPixel(start.pixel)) }

  private val read  = io.port.read
  private val use   = Cat(io.port.isBounce, io.port.isBounce && !io.port.backSide)
  private val index = io.count(log2Ceil(Gather.maxBounces) - 1, 0) ^ use
  private val pixel = points.read(read.bits, read.valid)
  io.port.hasLobe := io.count < io.gather.bounces || !io.port.isOn
  io.port.isOn    := io.gather.bounces =/= 0.U
  io.port.point.u := io.gather.points(index).u ^ pixel.u
  io.port.point.v := io.gather.points(index).v ^ pixel.v
}

object SamplePoints {
  val coordinateBits: Int = 10 // low bits of a pixel's coordinates that count

  /** Degree and coefficients of a primitive polynomial, and first direction numbers: the third and the fourth dimension
    * of Sobol's sequence (Joe and Kuo 2008).
    */
  private val sobol = Seq((2, 1, Seq(1, 3)), (3, 1, Seq(1, 3, 1)))

  /** For each byte of a point, what each bit of a pixel's Morton code adds to it; x is in the even bits, low ones
    * first.
    */
  val matrix: Seq[Seq[Int]] = sobol.map { case (degree, coefficients, first) =>
    val numbers = (degree until 2 * coordinateBits).foldLeft(first) { (m, k) =>
      val middle = (1 until degree).map(i => (coefficients >> (degree - 1 - i) & 1) * (m(k - i) << i))
      m :+ middle.foldLeft(m(k - degree) ^ (m(k - degree) << degree))(_ ^ _)
    }
    numbers.zipWithIndex.map { case (m, k) => ((m.toLong << SamplePoint.bits) >> (k + 1)).toInt }
  }

  /** The point of a pixel: one of a Sobol sequence in Morton order. */
  def ofPixel(pixel: PixelPosition): SamplePoint = {
    val bits = (0 until 2 * coordinateBits).map { bit =>
      val coordinate = if (bit % 2 == 0) pixel.x else pixel.y
      if (bit / 2 < coordinate.getWidth) coordinate(bit / 2) else false.B
    }
    val point = Wire(new SamplePoint)
    for ((to, columns) <- Seq(point.u, point.v).zip(matrix))
      to := VecInit.tabulate(SamplePoint.bits) { row =>
        bits.zip(columns).collect { case (bit, column) if (column >> row & 1) == 1 => bit }.reduce(_ ^ _)
      }.asUInt
    point
  }
}
