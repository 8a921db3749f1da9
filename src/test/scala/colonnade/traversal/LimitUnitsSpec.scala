package colonnade.traversal

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats
import colonnade.{Model, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class LimitUnitsSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LimitUnits"

  for ((config, i) <- TestConfigs.formats.zipWithIndex)
    it should s"follow the model, extremes included, format $i (${config.precision})" in {
      val numbers  = config.numbers
      val random   = new Random(1)
      val farthest = (BigInt(1) << (numbers.gridBits - 1)) - 1
      // Where saturation begins
      val brink =
        ((BigInt(1) << (numbers.vertexBits + 2)) - 2 - (BigInt(1) << numbers.boxPadLog)) << numbers.gridFraction.max(0)
      val around = (-3 to 3).map(brink + _).filter(limit => limit >= 0 && limit <= farthest)
      val limits = Seq(BigInt(0), BigInt(1), farthest, farthest - 1) ++ around ++
        Seq.fill(300)(BigInt(numbers.gridBits - 1, random) >> random.nextInt(numbers.gridBits - 1))
      val expected = Model.answers(config, limits.map(Seq(_)), "limit").map(_.head)
      test(new LimitUnitsHarness(config)) { dut =>
        for ((limit, units) <- limits.zip(expected)) {
          dut.limit.poke(limit.S)
          dut.units.expect(units.S)
        }
      }
    }
}

private class LimitUnitsHarness(config: ColonnadeConfig) extends Module {
  private val numbers = config.numbers

  val limit = IO(Input(SInt(numbers.gridBits.W)))
  val units = IO(Output(SInt(numbers.boxDistanceBits.W)))
  units := LimitUnits(numbers)(Fixed(new RayFormats(numbers).grid, limit)).integer
}
