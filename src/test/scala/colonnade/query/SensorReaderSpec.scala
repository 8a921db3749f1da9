package colonnade.query

import chiseltest._
import colonnade.OneSimulation
import colonnade.formats.{RayBatch, RaySensor}
import colonnade.numbers.Float32
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import java.lang.Float.floatToRawIntBits
import scala.util.Random

/** Directions of runs equal sums of integers that are rounded once, along rows and in tiles. */
class SensorReaderSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "SensorReader"

  inOneSimulation(new SensorReader)(
    "make a direction a cycle" -> make(willing = 1),
    "stand still"              -> make(willing = 0.5)
  )

  private def make(willing: Double)(dut: SensorReader): Unit = {
    val random = new Random(3)
    dut.clock.setTimeout(0)
    for (_ <- 0 until 12) {
      val sensor = TestSensor(random)
      sensor.poke(dut.io.sensor)
      val runs = Seq.fill(5) {
        val isTile = random.nextBoolean()
        (
          TestSensor(random).corner,
          if (isTile || random.nextBoolean()) Run.rays else 1 + random.nextInt(Run.rays),
          isTile
        )
      }
      val expected = for ((first, count, isTile) <- runs; index <- 0 until count) yield {
        val (column, row) = TestSensor.positionOf(index, isTile)
        (TestSensor.floats(sensor.sum(first, column, row)), index + 1 == count)
      }
      var (next, taken, cycles) = (0, 0, 0)
      while (taken < expected.size) {
        val offers = next < runs.size && random.nextDouble() < willing
        dut.io.runs.valid.poke(offers)
        if (offers) {
          val (first, count, isTile) = runs(next)
          first.zip(dut.io.runs.bits.dir).foreach { case (from, to) => to.poke(from) }
          dut.io.runs.bits.count.poke(count)
          dut.io.runs.bits.isTile.poke(isTile)
        }
        val accepts = random.nextDouble() < willing
        dut.io.directions.ready.poke(accepts)
        if (dut.io.directions.valid.peekBoolean()) withClue(s"ray $taken of $runs, $sensor: ") {
          (dut.io.directions.bits.map(FloatPorts.peek), dut.io.isLast.peekBoolean()) shouldBe expected(taken)
          if (accepts) taken += 1
        }
        if (offers && dut.io.runs.ready.peekBoolean()) next += 1
        dut.clock.step()
        cycles += 1
        cycles should be < 6 * expected.size + 100
      }
      if (willing == 1) cycles should be <= expected.size + runs.size + 4
      dut.io.runs.valid.poke(false)
      dut.io.directions.ready.poke(true)
      for (_ <- 0 until 8) {
        dut.io.directions.valid.expect(false)
        dut.clock.step()
      }
    }
  }
}

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
