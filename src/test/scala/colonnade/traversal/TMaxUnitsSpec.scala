package colonnade.traversal

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.Fixed
import colonnade.ray.RayFormats
import colonnade.{Model, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class TMaxUnitsSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TMaxUnits"

  for ((config, i) <- TestConfigs.formats.zipWithIndex)
    it should s"follow the model, extremes included, format $i (${config.precision})" in {
      val numbers  = config.numbers
      val random   = new Random(1)
      val farthest = (BigInt(1) << (numbers.gridBits - 1)) - 1
      // Where saturation begins
      val brink =
        ((BigInt(1) << (numbers.vertexBits + 2)) - 2 - (BigInt(1) << numbers.boxPadLog)) << numbers.gridFraction.max(0)
      val around    = (-3 to 3).map(brink + _).filter(tMax => tMax >= 0 && tMax <= farthest)
      val tMaxUnits = Seq(BigInt(0), BigInt(1), farthest, farthest - 1) ++ around ++
        Seq.fill(300)(BigInt(numbers.gridBits - 1, random) >> random.nextInt(numbers.gridBits - 1))
      val expected = Model.answers(config, tMaxUnits.map(Seq(_)), "limit").map(_.head)
      test(new TMaxUnitsHarness(config)) { dut =>
        for ((tMax, units) <- tMaxUnits.zip(expected)) {
          dut.tMax.poke(tMax.S)
          dut.units.expect(units.S)
        }
      }
    }
}

private class TMaxUnitsHarness(config: ColonnadeConfig) extends Module {
  private val numbers = config.numbers

  val tMax  = IO(Input(SInt(numbers.gridBits.W)))
  val units = IO(Output(SInt(numbers.boxDistanceBits.W)))
  units := TMaxUnits(numbers)(Fixed(new RayFormats(numbers).grid, tMax)).integer
}
