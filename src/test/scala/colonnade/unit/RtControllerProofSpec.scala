package colonnade.unit

import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.{Always, Matrix, Proofs, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

class RtControllerProofSpec extends AnyFlatSpec with ChiselScalatestTester with Proofs {
  behavior of "RtController"

  private val environment = TestConfigs.withEnvironment(TestConfigs.environment)

  private def config(contexts: Int, base: ColonnadeConfig): ColonnadeConfig =
    base.copy(units = base.units.copy(pathContexts = contexts))

  for ((name, base) <- Seq("without" -> TestConfigs.tiny, "with" -> environment))
    it should s"give each path to its stages, once and in order, $name an environment" taggedAs Always.unless(
      !base.hasEnvironment
    ) in
      prove(new RtControllerProof(config(contexts = 2, base)))

  for ((name, base, cycles) <- Seq(("without", TestConfigs.tiny, 13), ("with", environment, 10)))
    it should s"give each of 17 paths to its stages, $name an environment" taggedAs Matrix in
      proveUntil(cycles)(new RtControllerProof(config(contexts = 17, base)))
}
