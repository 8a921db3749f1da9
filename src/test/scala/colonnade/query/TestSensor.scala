package colonnade.query

import java.lang.Float.floatToRawIntBits

import chiseltest._
import colonnade.formats.{RayBatch, RaySensor}
import colonnade.numbers.Float32

import scala.util.Random

/** A sensor: three numbers of 32 bits each. */
final case class TestSensor(corner: Seq[BigInt], right: Seq[BigInt], down: Seq[BigInt], columns: BigInt = 64) {
  def words: Seq[BigInt] = (corner ++ right ++ down :+ columns).padTo(16, BigInt(0))

  def poke(port: RaySensor): Unit = {
    for ((to, from) <- Seq(port.corner -> corner, port.right -> right, port.down -> down); axis <- 0 until 3)
      to(axis).poke(from(axis))
    port.columns.poke(columns)
  }

  /** The sum at a column and row of a run that begins with `first`. */
  def sum(first: Seq[BigInt], column: BigInt, row: BigInt): Seq[BigInt] =
    first.indices.map(axis => (first(axis) + column * right(axis) + row * down(axis)) & 0xffffffffL)
}

object TestSensor {

  /** With numbers of all magnitudes, and sums between two floats. */
  def apply(random: Random): TestSensor = {
    def number() = random.nextInt(4) match {
      case 0 => (BigInt(random.nextInt(1 << 24)) << (1 + random.nextInt(7))) + 1
      case 1 => Seq(BigInt(0), BigInt(0x7fffffff), BigInt(0x80000000L), BigInt(0xffffffffL))(random.nextInt(4))
      case _ => BigInt(1 + random.nextInt(32), random) * (if (random.nextBoolean()) 1 else -1)
    }
    val Seq(corner, right, down) = Seq.fill(3)(Seq.fill(3)(number() & 0xffffffffL))
    TestSensor(corner, right, down)
  }

  /** Of its words. */
  def of(words: Seq[BigInt]): TestSensor = {
    val Seq(corner, right, down) = words.take(9).padTo(9, BigInt(0)).grouped(3).toSeq
    TestSensor(corner, right, down, words.lift(9).getOrElse(64))
  }

  /** Words of the floats nearest to sums. */
  def floats(sums: Seq[BigInt]): Seq[BigInt] =
    sums.map(sum => BigInt(floatToRawIntBits((sum.toInt * math.pow(2, -RaySensor.fractionBits)).toFloat)) & 0xffffffffL)

  /** Column and row of a ray in its run. */
  def positionOf(index: Int, isTile: Boolean): (Int, Int) =
    if (isTile) (index % Run.tileColumns, index / Run.tileColumns) else (index, 0)
}

/** Floats at ports, by their bits. */
object FloatPorts {
  def peek(float: Float32): BigInt =
    (float.isNegative.peekInt() << 31) + (float.biased.peekInt() << 23) + float.fraction.peekInt()

  /** A batch's mode, and what its rays share: origin, tNear and tFar. */
  def poke(batch: RayBatch, mode: BigInt, shared: Seq[BigInt]): Unit = {
    batch.mode.poke(mode)
    for ((float, word) <- (batch.origin :+ batch.tNear :+ batch.tFar).zip(shared)) {
      float.isNegative.poke((word >> 31) == 1)
      float.biased.poke((word >> 23) & 255)
      float.fraction.poke(word & 0x7fffff)
    }
  }
}
